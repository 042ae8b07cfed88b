import { readFileSync } from 'node:fs';
import { Client, pause } from './client.ts';

// Eight clients that connect and disconnect: node .build/dev/soak.js ADDRESS PID [MINUTES]. Each looks around, rests, asks for a still, a
// photograph and a ray, and disconnects: most properly, some as when the network fails. Prints the program's memory as it goes.

const [address = '', process_id = '', minutes = '10'] = process.argv.slice(2);
const end = performance.now() + 60_000 * Number(minutes);
const count = { visits: 0, frames: 0, bytes: 0, refused: 0 };

const between = (low: number, high: number): number => low + Math.random() * (high - low);

function resident_mebibytes(): number {
  const match = /VmRSS:\s+(\d+)/.exec(readFileSync(`/proc/${process_id}/status`, 'utf8'));
  return Number(match?.[1] ?? 0) / 1024;
}

async function visit(): Promise<void> {
  const client = await Client.connect(address);
  count.visits += 1;
  const [width, height] = [Math.round(between(160, 960)), Math.round(between(90, 540))];
  const layers = client.hello?.layers ?? [];
  for (let turn = 0; turn < between(5, 30); turn++) {
    const layer = layers[Math.floor(Math.random() * layers.length)]?.name ?? 'rgb';
    client.request_view(turn, width, height, Math.random() < 0.7, { layer, time: Math.random(), ...(layer === 'difference' ? { photo: { split: 'test', index: 0 } } : {}) });
    if (Math.random() < 0.1) client.send({ type: 'still', id: 1, width: 320, height: 180 });
    if (Math.random() < 0.1) client.send({ type: 'photo', split: 'train', index: 0, width: 480 });
    if (Math.random() < 0.2) client.send({ type: 'probe', id: 1, x: Math.random(), y: Math.random() });
    if (Math.random() < 0.05) client.send({ type: 'sleep' });
    await pause(between(20, 300));
  }
  count.frames += client.frames;
  count.bytes += client.bytes;
  if (Math.random() < 0.3) client.terminate();
  else client.close();
}

async function visits(): Promise<void> {
  while (performance.now() < end) {
    await visit().catch(() => (count.refused += 1));
    await pause(between(0, 500));
  }
}

const told = setInterval(() => {
  const minute = Number(minutes) - (end - performance.now()) / 60_000;
  console.log(`${minute.toFixed(1)} min: ${resident_mebibytes().toFixed(1)} MiB, ${count.visits} visits, ${count.frames} frames`);
}, 30_000);
console.log(`0.0 min: ${resident_mebibytes().toFixed(1)} MiB`);
await Promise.all(Array.from({ length: 8 }, visits));
clearInterval(told);
await pause(3000);
console.log(`after: ${resident_mebibytes().toFixed(1)} MiB, ${count.visits} visits, ${count.frames} frames, ${(count.bytes / 2 ** 20).toFixed(0)} MiB sent, ${count.refused} refused`);
