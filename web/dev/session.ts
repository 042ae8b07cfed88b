import type { WebSocket } from 'ws';
import type {
  Camera,
  CameraPath,
  Hello,
  PathReply,
  PictureHeader,
  Reply,
  Request,
  ViewRequest,
} from '../src/messages.ts';
import { between } from '../src/math/flight.ts';
import { ray_through } from '../src/math/camera.ts';
import { png } from './png.ts';
import { probe, render } from './tracer.ts';

interface Host {
  hello: Hello;
  slow: number; // ms added to each frame
  iteration(): number;
  command(what: 'pause' | 'resume' | 'save' | 'stop'): void;
}

const steps = [8, 4, 2, 1]; // how many times coarser, one after the other

// The fake server's end of one page's connection.
export class Session {
  private view: ViewRequest | null = null;
  private step = 0;
  private frame = 0;
  private shown = 0;
  private busy = false;
  private readonly socket: WebSocket;
  private readonly host: Host;

  constructor(socket: WebSocket, host: Host) {
    this.socket = socket;
    this.host = host;
    socket.on('message', (data: Buffer) => this.receive(JSON.parse(String(data)) as Request));
  }

  send(reply: Reply): void {
    this.socket.send(JSON.stringify(reply));
  }

  // The scene has changed.
  refresh(): void {
    this.step = this.view?.moving ? 0 : 2;
    this.work();
  }

  private send_picture(header: PictureHeader, bytes: Buffer): void {
    const text = Buffer.from(JSON.stringify(header));
    const size = Buffer.alloc(4);
    size.writeUInt32LE(text.length);
    this.socket.send(Buffer.concat([size, text, bytes]));
  }

  private receive(request: Request): void {
    switch (request.type) {
      case 'view':
        this.view = request;
        this.step = 0;
        return this.work();
      case 'sleep':
        this.view = null;
        return;
      case 'frame_shown':
        this.shown = Math.max(this.shown, request.frame);
        return this.work();
      case 'command':
        return this.host.command(request.do);
      case 'photo': {
        const captured = this.host.hello.cameras[request.split][request.index];
        if (!captured)
          return this.send({ type: 'refused', request: 'photo', id: 0, text: 'There is no such photograph.' });
        const width = Math.min(request.width, captured.width);
        const height = Math.round((width * captured.height) / captured.width);
        const wanted = { layer: 'photograph', exposure: 0, map: '' };
        const { split, index } = request;
        return void render(captured, captured.time, width, height, wanted).then((rows) => {
          if (rows)
            this.send_picture({ type: 'photo', split, index, width, height, format: 'jpeg' }, png(rows, width, height));
        });
      }
      case 'probe': {
        const from = this.camera();
        if (!this.view || !from) return;
        const along = ray_through(from, this.view.width / this.view.height, request);
        return this.send(probe(from, this.view.time, along, request.id));
      }
      case 'still': {
        const from = this.camera();
        if (!this.view || !from) return;
        const { id, width, height } = request;
        if (width * height > 3e7)
          return this.send({
            type: 'refused',
            request: 'still',
            id,
            text: 'A picture of this size would not fit into memory.',
          });
        return void render(from, this.view.time, width, height, this.view).then((rows) => {
          if (rows) this.send_picture({ type: 'still', id, width, height, format: 'png' }, png(rows, width, height));
        });
      }
      case 'path':
        return this.send({ type: 'path', id: request.id, shots: shots(request.path, this.host.hello) });
    }
  }

  private camera(): Camera | undefined {
    const ref = this.view?.photo;
    return ref ? this.host.hello.cameras[ref.split][ref.index] : this.view?.camera;
  }

  private work(): void {
    if (this.busy || !this.view || this.frame - this.shown >= 2 || this.step >= steps.length) return;
    this.busy = true;
    setTimeout(() => {
      void this.draw().then(() => {
        this.busy = false;
        this.work();
      });
    }, this.host.slow);
  }

  private async draw(): Promise<void> {
    const { view } = this;
    const from = this.camera();
    if (!view || !from) return;
    const coarse = view.moving ? Math.max(2, Math.sqrt((view.width * view.height) / 30000)) : (steps[this.step] ?? 1);
    const width = Math.max(1, Math.round(view.width / coarse));
    const height = Math.max(1, Math.round(view.height / coarse));
    const begin = performance.now();
    const rows = await render(from, view.time, width, height, view, () => !view.moving && view !== this.view);
    if (!rows) return;
    const bytes = png(rows, width, height);
    // A newer request has its own steps to go.
    if (view === this.view) this.step = view.moving ? steps.length : this.step + 1;
    const header = {
      type: 'frame' as const,
      frame: ++this.frame,
      view: view.id,
      width,
      height,
      final: !view.moving && this.step === steps.length,
      milliseconds: performance.now() - begin,
      iteration: this.host.iteration(),
      format: 'jpeg' as const,
    };
    this.send_picture(header, bytes);
  }
}

function shots(path: CameraPath, hello: Hello): PathReply['shots'] {
  const keys = path.closed ? [...path.keyframes, ...path.keyframes.slice(0, 1)] : path.keyframes;
  return keys.slice(1).flatMap((to, i) => {
    const from = keys[i] ?? to;
    const frames = Math.max(1, Math.round(from.seconds * path.fps));
    return Array.from({ length: frames }, (_, k) => ({
      camera: between(from, to, hello.target, k / frames),
      time: from.time + ((to.time - from.time) * k) / frames,
    }));
  });
}
