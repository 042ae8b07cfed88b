import type { Reply, Request } from '../messages.ts';
import { parse_picture, parse_reply, type Picture } from './wire.ts';

export type Link =
  | { kind: 'connecting'; again: boolean }
  | { kind: 'open' }
  | { kind: 'lost'; retry_at: number } // on the clock of Date.now()
  | { kind: 'locked' }; // a server answers, but not to this page's token

export interface Listener {
  link(link: Link): void;
  reply(reply: Reply): void;
  picture(picture: Picture): void;
}

// Milliseconds to wait before the n-th attempt in a row (from 0) to connect again.
export const pause_before = (attempt: number): number => [500, 1000, 2000, 3500][attempt] ?? 5000;

// A WebSocket to the server that opens itself again after it was lost.
export class Connection {
  private socket: WebSocket | null = null;
  private attempt = 0;
  private timer = 0;
  private readonly listener: Listener;

  constructor(listener: Listener) {
    this.listener = listener;
    this.open(false);
  }

  // Whether it could be sent.
  send(request: Request): boolean {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(request));
    return true;
  }

  retry_now(): void {
    if (this.socket !== null) return;
    clearTimeout(this.timer);
    this.open(true);
  }

  private open(again: boolean): void {
    this.listener.link({ kind: 'connecting', again });
    const socket = new WebSocket(new URL('/ws', location.href.replace(/^http/, 'ws')));
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => {
      this.attempt = 0;
      this.listener.link({ kind: 'open' });
    };
    socket.onmessage = ({ data }: MessageEvent<string | ArrayBuffer>) => {
      if (typeof data === 'string') this.listener.reply(parse_reply(data));
      else this.listener.picture(parse_picture(data));
    };
    socket.onclose = () => void this.lost();
    this.socket = socket;
  }

  private async lost(): Promise<void> {
    const pause = pause_before(this.attempt++);
    this.listener.link({ kind: 'lost', retry_at: Date.now() + pause });
    this.socket = null;
    this.timer = window.setTimeout(() => this.open(true), pause);
    if (await answers_forbidden()) {
      clearTimeout(this.timer);
      this.listener.link({ kind: 'locked' });
    }
  }
}

// Whether a server is there that does not know this page: it was started anew, with another token.
async function answers_forbidden(): Promise<boolean> {
  try {
    return (await fetch('/', { cache: 'no-store' })).status === 403;
  } catch {
    return false;
  }
}
