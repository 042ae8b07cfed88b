import type { FrameHeader, Look } from '../messages.ts';

export type Wish = Omit<Look, 'type' | 'id' | 'moving'>;

export interface SentLook {
  look: Look;
  input: number; // when the earliest input in it happened
  sent: number;
}

export interface Clock {
  now(): number; // milliseconds
  after(milliseconds: number, f: () => void): void;
}

const rest_after = 150; // ms without input until a picture is at rest
const patience = 2000; // ms until an unanswered look stops holding back the next
const remembered = 32;

// Decides which looks are sent when: no faster than they are answered, the newest always wins, and the last of a
// movement asks for a picture at rest.
export class Looker {
  private readonly send: (look: Look) => boolean;
  private readonly clock: Clock;
  private wish: Wish | null = null;
  private pending_input: number | null = null; // of what has not been sent
  private last_motion = -Infinity;
  private sent: SentLook[] = []; // the newest last
  private answered = 0; // id of the newest look that a frame answered
  private next = 1;
  private overhead = 0; // ms of an answer that were not spent rendering, running mean
  private rendering = 1;

  constructor(send: (look: Look) => boolean, clock: Clock) {
    this.send = send;
    this.clock = clock;
  }

  // What is to be seen from now on.
  want(wish: Wish): void {
    this.wish = wish;
    this.pending_input ??= this.clock.now();
    this.pump();
  }

  // Input that goes on: frames may be coarse until it ends.
  motion(): void {
    this.last_motion = this.clock.now();
    this.pending_input ??= this.last_motion;
    this.clock.after(rest_after + 5, () => this.settle());
  }

  find(look: number): SentLook | undefined {
    return this.sent.find((s) => s.look.id === look);
  }

  // A frame came. Returns the look that it answers if it is the first to do so.
  answer(frame: FrameHeader): SentLook | undefined {
    if (frame.look <= this.answered) return undefined;
    this.answered = frame.look;
    const look = this.find(frame.look);
    if (look) {
      const took = this.clock.now() - look.sent;
      this.overhead += 0.2 * (Math.max(took - frame.milliseconds, 0) - this.overhead);
      this.rendering += 0.2 * (frame.milliseconds - this.rendering);
    }
    this.pump();
    return look;
  }

  // After a reconnection nothing is under way any more.
  restart(): void {
    this.answered = this.next - 1;
  }

  // Milliseconds that the oldest unanswered look has waited; 0 if none does.
  waiting(): number {
    const oldest = this.sent.find((s) => s.look.id > this.answered);
    return oldest ? this.clock.now() - oldest.sent : 0;
  }

  private is_moving(): boolean {
    return this.clock.now() - this.last_motion < rest_after;
  }

  private settle(): void {
    const last = this.sent.at(-1);
    if (this.is_moving() || !last?.look.moving) return;
    this.pending_input ??= this.clock.now();
    this.pump();
  }

  private pump(): void {
    if (!this.wish || this.pending_input === null) return;
    const now = this.clock.now();
    const unanswered = this.sent.filter((s) => s.look.id > this.answered && now - s.sent < patience);
    // On a slow line a second look under way hides the way back; on a fast one it would only grow old.
    if (unanswered.length >= (this.overhead > this.rendering ? 2 : 1)) {
      this.clock.after(patience, () => this.pump());
      return;
    }
    const look: Look = { type: 'look', id: this.next, ...this.wish, moving: this.is_moving() };
    if (!this.send(look)) return;
    this.next++;
    this.sent = [...this.sent.slice(-remembered), { look, input: this.pending_input, sent: now }];
    this.pending_input = null;
  }
}
