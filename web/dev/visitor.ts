import { WebSocket } from 'ws';
import type { FrameHeader, Hello, Look, PictureHeader, Reply, Request, State } from '../src/messages.ts';

// A page without a browser: it connects to the program as the page does, and counts what comes.
export class Visitor {
  frames = 0;
  bytes = 0;
  latencies: number[] = []; // ms from a look to the first frame of it
  hello: Hello | undefined;
  state: State | undefined;
  last: FrameHeader | undefined;
  trained = 0; // seconds that went into the training, of its last step
  private readonly asked = new Map<number, number>();
  private readonly socket: WebSocket;
  private look_id = 0;
  onframe: (header: FrameHeader) => void = () => undefined;

  private constructor(socket: WebSocket) {
    this.socket = socket;
    socket.on('message', (data: Buffer, binary: boolean) => this.hear(data, binary));
    socket.on('error', () => undefined);
  }

  // address: as the program prints it, token included.
  static async enter(address: string): Promise<Visitor> {
    const { origin } = new URL(address);
    const cookie = ((await fetch(address)).headers.get('set-cookie') ?? '').split(';')[0] ?? '';
    const socket = new WebSocket(`${origin.replace('http', 'ws')}/ws`, { headers: { Cookie: cookie }, origin });
    const visitor = new Visitor(socket);
    await new Promise((open, failed) => {
      socket.once('open', open);
      socket.once('error', failed);
    });
    while (!visitor.hello) await new Promise((wait) => setTimeout(wait, 5));
    return visitor;
  }

  say(request: Request): void {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(request));
  }

  // Looks from beside the first camera, so far as `turn` says.
  look(turn: number, width: number, height: number, moving: boolean, more: Partial<Look> = {}): void {
    if (!this.hello) return;
    const { start, extent } = this.hello;
    const position: [number, number, number] = [...start.position];
    position[0] += 0.05 * extent * Math.sin(turn);
    position[1] += 0.05 * extent * Math.cos(turn);
    this.look_id += 1;
    this.asked.set(this.look_id, performance.now());
    const look: Look = { type: 'look', id: this.look_id, time: 0, width, height, layer: 'rgb', exposure: 0, map: 'viridis', moving, ...more };
    this.say(look.photo ? look : { ...look, camera: { ...start, position } });
  }

  leave(): void {
    this.socket.close();
  }

  // As when the network fails.
  vanish(): void {
    this.socket.terminate();
  }

  private hear(data: Buffer, binary: boolean): void {
    this.bytes += data.length;
    if (!binary) {
      const reply = JSON.parse(String(data)) as Reply;
      if (reply.type === 'hello') this.hello = reply;
      if (reply.type === 'state') this.state = reply;
      if (reply.type === 'events') {
        for (const event of reply.events) if (event.event === 'step') this.trained = event.seconds;
      }
      return;
    }
    const header = JSON.parse(data.toString('utf8', 4, 4 + data.readUInt32LE(0))) as PictureHeader;
    if (header.type !== 'frame') return;
    this.frames += 1;
    this.last = header;
    const since = this.asked.get(header.look);
    if (since !== undefined) this.latencies.push(performance.now() - since);
    for (const id of this.asked.keys()) if (id <= header.look) this.asked.delete(id);
    this.say({ type: 'seen', frame: header.frame });
    this.onframe(header);
  }
}

export const pause = (ms: number): Promise<void> => new Promise((end) => setTimeout(end, ms));

export function percentile(values: readonly number[], share: number): number {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))] ?? NaN;
}
