import { readFile } from 'node:fs/promises';
import { createServer, type IncomingMessage, type ServerResponse } from 'node:http';
import { WebSocketServer } from 'ws';
import type { Hello, State } from '../src/messages.ts';
import { look_at } from '../src/math/camera.ts';
import { captured_cameras, start } from './scene.ts';
import { Session } from './session.ts';
import { Training } from './training.ts';

// Stands in for `traceflow train --view` and `traceflow view` while the page is worked on: the same messages, drawn
// pictures. SOURCE=training|run|ply, PORT, TOKEN, PAST (iterations that are over), MOVES=0, SLOW (ms added to a frame).

const { PORT = '5174', TOKEN = 'token', SOURCE = 'training', PAST = '2600', MOVES = '1', SLOW = '0' } = process.env;
const source = SOURCE as Hello['source'];

const training = new Training();
let log = training.begin();
const past = source === 'training' ? Number(PAST) : 1e9;
while (source !== 'ply' && !training.over && training.iteration < past) log = [...log, ...training.advance()];

const colours = ['rgb', 'diffuse', 'specular', 'normal', 'surfels', 'tracks', 'difference'];
const numbers = ['tint', 'alpha', 'depth', 'median-depth', 'distortion'];
const hello: Hello = {
  type: 'hello',
  version: '0.7.0',
  source,
  name: source === 'ply' ? 'point_cloud.ply' : 'kettle-spheres',
  capture: source === 'ply' ? '' : 'kettle',
  device: 'cpu',
  moves: MOVES !== '0' && source !== 'ply',
  layers: [
    ...colours.map((name) => ({ name, kind: 'colour' as const })),
    ...numbers.map((name) => ({ name, kind: 'number' as const })),
  ],
  maps: ['viridis', 'turbo', 'grey'],
  cameras: source === 'ply' ? { train: [], test: [] } : captured_cameras,
  start: look_at(start, [0, 0, 0.25], [0, 0, 1], 34),
  target: [0, 0, 0.25],
  up: [0, 0, 1],
  extent: 2.4,
};

const state = (): State => ({
  type: 'state',
  paused: training.paused,
  over: source !== 'training' || training.over,
  iteration: training.iteration,
  iterations: source === 'ply' ? 0 : 8000,
  surfels: source === 'ply' ? { main: 184203, environment: 0 } : training.surfels(),
  viewers: sessions.size,
});

const sessions = new Set<Session>();
const tell_state = (): void => sessions.forEach((session) => session.send(state()));

const policy =
  "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; base-uri 'none'";
const types: Record<string, string> = {
  html: 'text/html',
  js: 'text/javascript',
  css: 'text/css',
  svg: 'image/svg+xml',
};

function is_known(request: IncomingMessage): boolean {
  const brought = new URL(request.url ?? '/', 'http://x').searchParams.get('token') === TOKEN;
  return brought || (request.headers.cookie ?? '').includes(`traceflow_fake=${TOKEN}`);
}

async function answer(request: IncomingMessage, response: ServerResponse): Promise<void> {
  const path = new URL(request.url ?? '/', 'http://x').pathname;
  if (!is_known(request)) return void response.writeHead(403).end('Open the whole address that the terminal printed.');
  const name = path === '/' ? 'index.html' : path.slice(1);
  if (!/^[a-z]+\.(html|js|css|svg)$/.test(name)) return void response.writeHead(404).end();
  const body = await readFile(new URL(`../../page/${name}`, import.meta.url));
  response.writeHead(200, {
    'Content-Type': types[name.split('.')[1] ?? ''] ?? 'text/plain',
    'Content-Security-Policy': policy,
    'Set-Cookie': `traceflow_fake=${TOKEN}; HttpOnly; SameSite=Strict; Path=/`,
  });
  response.end(body);
}

const server = createServer(
  (request, response) => void answer(request, response).catch(() => response.writeHead(404).end()),
);
const sockets = new WebSocketServer({
  server,
  path: '/ws',
  verifyClient: ({ req }: { req: IncomingMessage }) => is_known(req) || process.env['OPEN'] === '1',
});

sockets.on('connection', (socket) => {
  const session: Session = new Session(socket, {
    hello,
    slow: Number(SLOW),
    iteration: () => training.iteration,
    command(what) {
      if (what === 'pause') training.paused = true;
      if (what === 'resume') training.paused = false;
      if (what === 'stop' && !training.over) publish([training.end('interrupted')]);
      if (what === 'save')
        publish([{ event: 'saved', iteration: training.iteration, path: 'checkpoint.safetensors', seconds: 0.3 }]);
      tell_state();
    },
  });
  sessions.add(session);
  socket.on('close', () => {
    sessions.delete(session);
    tell_state();
  });
  session.send(hello);
  session.send({ type: 'events', events: log, reset: true });
  tell_state();
});

function publish(made: typeof log): void {
  if (made.length === 0) return;
  log = [...log, ...made];
  sessions.forEach((session) => session.send({ type: 'events', events: made, reset: false }));
}

if (source === 'training') {
  setInterval(() => {
    const before = training.iteration;
    publish(training.advance());
    if (training.iteration === before) return;
    tell_state();
    if (training.iteration % 100 === 0) sessions.forEach((session) => session.refresh());
  }, 400);
}

// What goes wrong, on demand: a line on standard input becomes the warning, an empty one ends it.
process.stdin.on('data', (text: Buffer) =>
  sessions.forEach((session) => session.send({ type: 'warning', text: String(text).trim() })),
);
process.stdin.unref?.();

server.listen(Number(PORT), '127.0.0.1', () => {
  const address = server.address();
  const port = typeof address === 'object' && address ? address.port : PORT;
  console.log(`view: http://127.0.0.1:${port}/?token=${TOKEN}`);
});
