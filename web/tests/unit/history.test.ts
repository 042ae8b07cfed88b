import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { TrainingEvent } from '../../src/messages.ts';
import { History } from '../../src/state/history.ts';
import { step } from './steps.ts';

const started = (iteration: number): TrainingEvent => ({
  event: 'started',
  capture: '',
  run: '',
  iteration,
  iterations: 1000,
  device: 'cpu',
  threads: 1,
  seed: 0,
  surfels: { main: 1, environment: 1 },
  forecast_bytes: 0,
});
const evaluated = (iteration: number): TrainingEvent => ({
  event: 'evaluated',
  iteration,
  split: 'test',
  views: 1,
  psnr: 1,
  ssim: 1,
  seconds: 1,
});
const finished = (iteration: number): TrainingEvent => ({
  event: 'finished',
  ending: 'interrupted',
  iteration,
  seconds: 1,
  psnr: 1,
  surfels: { main: 1, environment: 1 },
  reason: '',
});
const phase = (iteration: number): TrainingEvent => ({ event: 'phase_entered', iteration, phase: `from ${iteration}` });
const warning = (iteration: number, text: string): TrainingEvent => ({ event: 'warning', iteration, text });

function told(...events: TrainingEvent[]): string[] {
  const history = new History();
  events.forEach((e) => history.add(e));
  return history.list().map((e) => `${e.event} ${e.iteration}`);
}

test('a long run keeps every n-th step and everything else', () => {
  const history = new History();
  history.add(started(0));
  for (let i = 1; i <= 20000; i++) {
    history.add(step(i));
    if (i % 1001 === 0) history.add(evaluated(i));
  }
  const steps = history.list().filter((e) => e.event === 'step');
  assert.deepEqual(
    steps.map((e) => e.iteration),
    Array.from({ length: 2500 }, (_, i) => 8 * (i + 1)),
  );
  assert.equal(history.list().length, 2500 + 1 + 19);
});

test('a resumed run goes back to its checkpoint', () => {
  const first = [started(0), phase(0), step(10), evaluated(10), phase(20), step(20), step(30), evaluated(30)];
  assert.deepEqual(told(...first, finished(30), started(20), phase(20), step(21)), [
    'started 0',
    'phase_entered 0',
    'step 10',
    'evaluated 10',
    'step 20',
    'started 20',
    'phase_entered 20',
    'step 21',
  ]);
});

test('a run that begins anew takes all back, as do steps that do', () => {
  assert.deepEqual(told(started(0), step(10), finished(10), started(0), step(1)), ['started 0', 'step 1']);
  assert.deepEqual(told(started(0), step(10), step(20), step(30), step(15)), ['started 0', 'step 10', 'step 15']);
});

test('a warning is told once, unless the run went back before it', () => {
  assert.deepEqual(told(warning(1, 'a'), warning(2, 'a'), warning(3, 'b')), ['warning 1', 'warning 3']);
  assert.deepEqual(told(step(1), warning(5, 'a'), started(2), warning(6, 'a')), ['step 1', 'started 2', 'warning 6']);
});
