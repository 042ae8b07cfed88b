import { spawn, type ChildProcess } from 'node:child_process';
import { connect, createServer, type AddressInfo, type Server, type Socket } from 'node:net';
import { fileURLToPath } from 'node:url';

// A server for a test, behind a line that the test can cut. Without anything said it is the stand-in of dev/; the
// environment gives others: VIEW_COMMAND and TRAIN_COMMAND, shell commands such as "traceflow view RUN" and "traceflow
// train … --view" that print the address and take --port and --allow-host.

export type Kind = 'view' | 'train';

const fake = fileURLToPath(new URL('../../dev/fake_server.js', import.meta.url));
const commands = { view: process.env['VIEW_COMMAND'], train: process.env['TRAIN_COMMAND'] };
export const real = commands.view !== undefined || commands.train !== undefined;

// Whether there is a server of this kind to test.
export const available = (kind: Kind): boolean => !real || commands[kind] !== undefined;

export interface Served {
  address: string; // with its token
  cut(): void; // breaks every connection and lets none come
  restore(): void;
  warn(text: string): void; // makes the stand-in send a warning, an empty one ends it
  restart(): Promise<void>; // as another server, with another token, at the same address
  stop(): Promise<void>;
}

export async function serve(kind: Kind): Promise<Served> {
  const line = new Line();
  await line.open();
  let program = await start(kind, line.port, 'first');
  line.target = program.port;
  return {
    address: `http://127.0.0.1:${line.port}/?token=${program.token}`,
    cut: () => line.cut(),
    restore: () => line.restore(),
    warn: (text) => void program.process.stdin?.write(`${text}\n`),
    async restart() {
      await end(program.process);
      program = await start(kind, line.port, 'second');
      line.target = program.port;
    },
    async stop() {
      line.close();
      await end(program.process);
    },
  };
}

interface Program {
  process: ChildProcess;
  port: number;
  token: string;
}

function start(kind: Kind, seen_port: number, token: string): Promise<Program> {
  const command = commands[kind];
  const environment = { ...process.env, PORT: '0', TOKEN: token, SOURCE: kind === 'view' ? 'run' : 'training' };
  const child = command
    ? spawn(`exec ${command} --port 0 --allow-host 127.0.0.1:${seen_port}`, {
        shell: true,
        stdio: ['ignore', 'pipe', 'pipe'],
      })
    : spawn(process.execPath, [fake], { env: environment, stdio: ['pipe', 'pipe', 'pipe'] });
  return new Promise((found, failed) => {
    let said = '';
    // The program says its address among its other remarks.
    for (const stream of [child.stdout, child.stderr]) {
      stream?.on('data', (text: Buffer) => {
        said += String(text);
        const match = /http:\/\/[^\s/]*:(\d+)\/\?token=(\S+)/.exec(said);
        if (match) found({ process: child, port: Number(match[1]), token: match[2] ?? '' });
      });
    }
    child.on('exit', (code) => failed(new Error(`the server ended with ${code}: ${said}`)));
  });
}

function end(child: ChildProcess): Promise<void> {
  if (child.exitCode !== null) return Promise.resolve();
  return new Promise((ended) => {
    child.removeAllListeners('exit');
    child.once('exit', () => ended());
    child.kill('SIGKILL');
  });
}

// A TCP port that passes everything on to another.
class Line {
  target = 0;
  port = 0;
  private whole = true;
  private readonly ends = new Set<Socket>();
  private readonly server: Server = createServer((near) => this.pass(near));

  open(): Promise<void> {
    return new Promise((ready) =>
      this.server.listen(0, '127.0.0.1', () => {
        this.port = (this.server.address() as AddressInfo).port;
        ready();
      }),
    );
  }

  cut(): void {
    this.whole = false;
    this.ends.forEach((socket) => socket.destroy());
  }

  restore(): void {
    this.whole = true;
  }

  close(): void {
    this.cut();
    this.server.close();
  }

  private pass(near: Socket): void {
    if (!this.whole) return void near.destroy();
    const far = connect(this.target, '127.0.0.1');
    for (const [from, to] of [
      [near, far],
      [far, near],
    ] as const) {
      this.ends.add(from);
      from.setNoDelay(true);
      from.pipe(to);
      from.on('error', () => to.destroy());
      from.on('close', () => {
        this.ends.delete(from);
        to.destroy();
      });
    }
  }
}
