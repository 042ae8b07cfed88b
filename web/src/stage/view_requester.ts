import type { FrameHeader, ViewRequest } from '../messages.ts';

export type WantedView = Omit<ViewRequest, 'type' | 'id' | 'moving'>;

export interface SentView {
  view: ViewRequest;
  input: number; // when the earliest input in it happened
  sent: number;
}

export interface Clock {
  now(): number; // milliseconds
  after(milliseconds: number, f: () => void): void;
}

const rest_after = 150; // ms without input until a picture is at rest
const patience = 2000; // ms until an unanswered request stops holding back the next
const remembered = 32;

// Decides which views are requested when: no faster than they are answered, the newest always wins, and the last of a
// movement asks for a picture at rest.
export class ViewRequester {
  private readonly send: (view: ViewRequest) => boolean;
  private readonly clock: Clock;
  private wanted: WantedView | null = null;
  private pending_input: number | null = null; // of what has not been sent
  private last_motion = -Infinity;
  private sent: SentView[] = []; // the newest last
  private answered = 0; // id of the newest request that a frame answered
  private next = 1;
  private overhead = 0; // ms of an answer that were not spent rendering, running mean
  private rendering = 1;
  private asleep = false;

  constructor(send: (view: ViewRequest) => boolean, clock: Clock) {
    this.send = send;
    this.clock = clock;
  }

  // What is to be seen from now on.
  want(view: WantedView): void {
    this.wanted = view;
    this.pending_input ??= this.clock.now();
    this.pump();
  }

  // Input that goes on: frames may be coarse until it ends.
  motion(): void {
    this.last_motion = this.clock.now();
    this.pending_input ??= this.last_motion;
    this.clock.after(rest_after + 5, () => this.settle());
  }

  find(id: number): SentView | undefined {
    return this.sent.find((s) => s.view.id === id);
  }

  // A frame came. Returns the view that it answers if it is the first to do so.
  answer(frame: FrameHeader): SentView | undefined {
    if (frame.view <= this.answered) return undefined;
    this.answered = frame.view;
    const view = this.find(frame.view);
    if (view) {
      const took = this.clock.now() - view.sent;
      this.overhead += 0.2 * (Math.max(took - frame.milliseconds, 0) - this.overhead);
      this.rendering += 0.2 * (frame.milliseconds - this.rendering);
    }
    this.pump();
    return view;
  }

  // No frame will answer this request.
  refused(id: number): void {
    this.answered = Math.max(this.answered, id);
    this.pump();
  }

  // While the page is hidden nothing is sent, whatever was to come; after that not before a view is wanted.
  sleep(asleep: boolean): void {
    if (asleep === this.asleep) return;
    this.asleep = asleep;
    this.pending_input = null;
    this.restart(); // what is under way may never be answered
  }

  // After a reconnection nothing is under way any more.
  restart(): void {
    this.answered = this.next - 1;
  }

  // Milliseconds that the oldest unanswered request has waited; 0 if none does.
  waiting(): number {
    const oldest = this.sent.find((s) => s.view.id > this.answered);
    return oldest ? this.clock.now() - oldest.sent : 0;
  }

  private is_moving(): boolean {
    return this.clock.now() - this.last_motion < rest_after;
  }

  private settle(): void {
    const last = this.sent.at(-1);
    if (this.is_moving() || !last?.view.moving) return;
    this.pending_input ??= this.clock.now();
    this.pump();
  }

  private pump(): void {
    if (this.asleep || !this.wanted || this.pending_input === null) return;
    const now = this.clock.now();
    const unanswered = this.sent.filter((s) => s.view.id > this.answered && now - s.sent < patience);
    // On a slow line a second request under way hides the way back; on a fast one it would only grow old.
    if (unanswered.length >= (this.overhead > this.rendering ? 2 : 1)) {
      this.clock.after(patience, () => this.pump());
      return;
    }
    const view: ViewRequest = { type: 'view', id: this.next, ...this.wanted, moving: this.is_moving() };
    if (!this.send(view)) return;
    this.next++;
    this.sent = [...this.sent.slice(-remembered), { view, input: this.pending_input, sent: now }];
    this.pending_input = null;
  }
}
