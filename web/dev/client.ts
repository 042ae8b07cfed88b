import { WebSocket } from 'ws';
import type { FrameHeader, Hello, PictureHeader, Reply, Request, State, ViewRequest } from '../src/messages.ts';

// A client without a browser: it connects to the program as the page does, and counts what comes.
export class Client {
  frames = 0;
  bytes = 0;
  latencies: number[] = []; // ms from a ViewRequest to its first frame
  hello: Hello | undefined;
  state: State | undefined;
  last: FrameHeader | undefined;
  trained = 0; // seconds that went into the training, of its last step
  private readonly asked = new Map<number, number>();
  private readonly socket: WebSocket;
  private view_id = 0;
  onframe: (header: FrameHeader) => void = () => undefined;

  private constructor(socket: WebSocket) {
    this.socket = socket;
    socket.on('message', (data: Buffer, binary: boolean) => this.receive(data, binary));
    socket.on('error', () => undefined);
  }

  // address: as the program prints it, token included.
  static async connect(address: string): Promise<Client> {
    const { origin } = new URL(address);
    const cookie = ((await fetch(address)).headers.get('set-cookie') ?? '').split(';')[0] ?? '';
    const socket = new WebSocket(`${origin.replace('http', 'ws')}/ws`, { headers: { Cookie: cookie }, origin });
    const client = new Client(socket);
    await new Promise((open, failed) => {
      socket.once('open', open);
      socket.once('error', failed);
    });
    while (!client.hello) await new Promise((wait) => setTimeout(wait, 5));
    return client;
  }

  send(request: Request): void {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(request));
  }

  // Requests the view from beside the first camera, at the angle `turn`.
  request_view(turn: number, width: number, height: number, moving: boolean, more: Partial<ViewRequest> = {}): void {
    if (!this.hello) return;
    const { start, extent } = this.hello;
    const position: [number, number, number] = [...start.position];
    position[0] += 0.05 * extent * Math.sin(turn);
    position[1] += 0.05 * extent * Math.cos(turn);
    this.view_id += 1;
    this.asked.set(this.view_id, performance.now());
    const view: ViewRequest = { type: 'view', id: this.view_id, time: 0, width, height, layer: 'rgb', exposure: 0, map: 'viridis', moving, ...more };
    this.send(view.photo ? view : { ...view, camera: { ...start, position } });
  }

  close(): void {
    this.socket.close();
  }

  // As when the network fails.
  terminate(): void {
    this.socket.terminate();
  }

  private receive(data: Buffer, binary: boolean): void {
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
    const since = this.asked.get(header.view);
    if (since !== undefined) this.latencies.push(performance.now() - since);
    for (const id of this.asked.keys()) if (id <= header.view) this.asked.delete(id);
    this.send({ type: 'frame_shown', frame: header.frame });
    this.onframe(header);
  }
}

export const pause = (ms: number): Promise<void> => new Promise((end) => setTimeout(end, ms));

export function percentile(values: readonly number[], share: number): number {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))] ?? NaN;
}
