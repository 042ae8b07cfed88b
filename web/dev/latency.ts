import { Client, pause, percentile } from './client.ts';

// How soon a ViewRequest is answered: node .build/dev/latency.js ADDRESS [WIDTH HEIGHT [REQUESTS]]. First a camera that turns without end,
// a request as soon as the last one is answered; then single requests at rest, until their last, full frame.

const [address = '', width = '480', height = '270', requests = '150'] = process.argv.slice(2);
const client = await Client.connect(address);
const size = [Number(width), Number(height)] as const;
const next_frame = (): Promise<void> => new Promise((come) => (client.onframe = () => come()));

let sizes = 0;
const start = performance.now();
for (let turn = 0; turn < Number(requests); turn++) {
  const come = next_frame();
  client.request_view(0.05 * turn, ...size, true);
  await come;
  if (turn === 20) client.latencies = [];
  sizes += (client.last?.width ?? 0) / size[0] / Number(requests);
}
const rate = Number(requests) / ((performance.now() - start) / 1000);
const tell = (what: string, values: readonly number[]): void =>
  console.log(`${what}: median ${percentile(values, 0.5).toFixed(0)} ms, 95 % within ${percentile(values, 0.95).toFixed(0)} ms`);
tell(`turning, ${rate.toFixed(1)} frames/s, ${(100 * sizes).toFixed(0)} % of the width; input to frame`, client.latencies);

const first: number[] = [];
const whole: number[] = [];
for (let turn = 0; turn < 20; turn++) {
  const asked = performance.now();
  client.latencies = [];
  client.request_view(turn, ...size, false);
  do await next_frame();
  while (!client.last?.final);
  whole.push(performance.now() - asked);
  first.push(client.latencies[0] ?? NaN);
  await pause(50);
}
tell('at rest, to the first frame', first);
tell('at rest, to the whole picture', whole);
client.close();
