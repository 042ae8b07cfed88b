import assert from 'node:assert/strict';
import { test } from 'node:test';
import { charts_of } from '../../src/curves/charts.ts';
import { remarks, seconds_left } from '../../src/curves/progress.ts';
import { series_of } from '../../src/curves/series.ts';
import { thinned } from '../../src/curves/thin.ts';
import { Training } from '../../dev/training.ts';
import { near } from './near.ts';
import { step } from './steps.ts';

test('thinning keeps ends, extremes and order', () => {
  const values = Array.from({ length: 10000 }, (_, i) => Math.sin(i / 100));
  values[4321] = 99;
  values[1234] = -99;
  const kept = thinned(values, 500);
  assert.ok(kept.length <= 502);
  for (const i of [0, 1234, 4321, 9999]) assert.ok(kept.includes(i), `${i} is missing`);
  assert.deepEqual(
    kept,
    [...kept].sort((a, b) => a - b),
  );
  assert.equal(new Set(kept).size, kept.length);
});

test('few values are all kept, missing ones too', () => {
  assert.deepEqual(thinned([1, null, 3], 10), [0, 1, 2]);
  assert.deepEqual(thinned([], 10), []);
  const gaps = Array.from({ length: 1000 }, (_, i) => (i % 3 ? null : i));
  assert.ok(thinned(gaps, 100).includes(999));
});

test('a term that comes later is zero before', () => {
  const { steps } = series_of([step(10, 1, { l1: 0.5 }), step(20, 0.9, { l1: 0.4, normal: 0.1 })]);
  assert.deepEqual(steps.terms.get('normal'), [0, 0.1]);
  assert.deepEqual(steps.memory, [null, null]);
});

test('phases follow one another', () => {
  const { phases } = series_of([
    { event: 'phase_entered', iteration: 0, phase: 'static' },
    step(10, 1),
    { event: 'phase_entered', iteration: 15, phase: 'joint' },
    step(40, 1),
  ]);
  assert.deepEqual(phases, [
    { name: 'static', first: 0, last: 15 },
    { name: 'joint', first: 15, last: 40 },
  ]);
});

test('changes of density are kept by set and cause', () => {
  const { density } = series_of([
    {
      event: 'density_changed',
      iteration: 80,
      set: 'environment',
      cloned: 1,
      split: 2,
      added: 5,
      pruned_transparent: 3,
      pruned_large: 4,
      opacity_reset: true,
      at_cap: false,
      count: 9,
    },
  ]);
  const { iteration, cloned, split, added, transparent, large, resets } = density.environment;
  assert.deepEqual([iteration, cloned, split, added, transparent, large, resets], [[80], [1], [2], [5], [3], [4], [80]]);
  assert.deepEqual(density.main.iteration, []);
});

test('every chart of a whole run has columns of one length', () => {
  const training = new Training();
  const events = training.begin();
  while (!training.over) events.push(...training.advance());
  const charts = charts_of(series_of(events), true, 'main');
  assert.deepEqual(
    charts.map((c) => c.id),
    ['loss', 'psnr', 'surfels', 'density', 'rate', 'memory'],
  );
  for (const chart of charts) {
    for (const line of chart.lines) assert.equal(line.values.length, chart.x.length, chart.id);
    assert.deepEqual(
      chart.x,
      [...chart.x].sort((a, b) => a - b),
    );
  }
  const loss = charts[0]?.lines.flatMap((line) => line.values) ?? [];
  assert.ok(loss.every((v) => v === null || v > 0));
});

test('what is left is reckoned from the last part', () => {
  assert.equal(seconds_left([]), null);
  const events = [step(10, 1), step(400, 1), step(500, 1)];
  near(seconds_left(events) ?? NaN, 50);
});

test('ends, saves and warnings are said in words', () => {
  assert.deepEqual(remarks([step(10)]), []);
  const warnings = ['a', 'b', 'c', 'd'].map((text, i) => ({ event: 'warning' as const, iteration: i, text }));
  const saved = { event: 'saved' as const, iteration: 1200, path: 'x', seconds: 0.1 };
  assert.deepEqual(remarks([...warnings, { ...saved, iteration: 600 }, saved]), [
    { text: 'Saved at iteration 1,200', wrong: false },
    { text: 'Warning: b', wrong: true },
    { text: 'Warning: c', wrong: true },
    { text: 'Warning: d', wrong: true },
  ]);
  const end = { event: 'finished' as const, iteration: 1300, seconds: 9, psnr: 20, surfels: { main: 1, environment: 1 } };
  assert.deepEqual(remarks([{ ...end, ending: 'completed', reason: '' }]), [
    { text: 'Completed at iteration 1,300', wrong: false },
  ]);
  assert.deepEqual(remarks([{ ...end, ending: 'out_of_memory', reason: 'std::bad_alloc' }]), [
    { text: 'Ran out of memory at iteration 1,300', wrong: true },
  ]);
  assert.deepEqual(remarks([{ ...end, ending: 'diverged', reason: 'the loss is not finite' }]), [
    { text: 'Diverged at iteration 1,300: the loss is not finite', wrong: true },
  ]);
  assert.deepEqual(remarks([{ ...end, ending: 'no_input', reason: 'rgb/1x/a.png: found nothing' }]), [
    { text: 'Lost its capture at iteration 1,300: rgb/1x/a.png: found nothing', wrong: true },
  ]);
});
