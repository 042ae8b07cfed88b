import { Client, pause } from './client.ts';

// What a viewer costs a training: node .build/dev/viewer_cost.js ADDRESS [SECONDS [ROUNDS]]. Turn about, nobody looks, somebody looks at
// a picture at rest, and somebody turns the camera without end; prints the iterations a second of each, the share of the time that went
// into pictures, and by how much the training slowed down in its own time.

const [address = '', seconds = '15', rounds = '4'] = process.argv.slice(2);
const client = await Client.connect(address);
const size = [480, 270] as const;

const kinds = ['nobody', 'at rest', 'moving'] as const;
const totals = new Map(kinds.map((kind) => [kind, { iterations: 0, seconds: 0, frames: 0, trained: 0 }]));
for (let round = 0; round < Number(rounds); round++) {
  for (const kind of kinds) {
    let turn = 0;
    client.onframe = () => kind === 'moving' && client.request_view((turn += 0.1), ...size, true);
    if (kind === 'nobody') client.send({ type: 'sleep' });
    else client.request_view(turn, ...size, kind === 'moving');
    await pause(1000); // what was begun ends, and the state is told
    const total = totals.get(kind);
    if (!total) break;
    const [iteration, frames, start, trained] = [client.state?.iteration ?? 0, client.frames, performance.now(), client.trained];
    await pause(1000 * Number(seconds));
    total.iterations += (client.state?.iteration ?? 0) - iteration;
    total.frames += client.frames - frames;
    total.seconds += (performance.now() - start) / 1000;
    total.trained += client.trained - trained;
  }
}
const percent = (part: number): string => `${(100 * part).toFixed(1)} %`;
const rate = (kind: (typeof kinds)[number]): number => {
  const total = totals.get(kind);
  return total ? total.iterations / total.seconds : 0;
};
for (const [kind, total] of totals) {
  const unwatched = totals.get('nobody') ?? total;
  const slower = 1 - total.iterations / total.trained / (unwatched.iterations / unwatched.trained);
  console.log(
    `${kind.padEnd(8)} ${rate(kind).toFixed(2)} iterations/s, ${(total.frames / total.seconds).toFixed(1)} frames/s, ` +
      `${percent(1 - rate(kind) / rate('nobody'))} lost: ${percent(1 - total.trained / total.seconds)} of the time in pictures, ` +
      `the training ${percent(slower)} slower in its own`,
  );
}
client.close();
