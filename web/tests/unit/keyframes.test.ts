import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { ViewRequest } from '../../src/messages.ts';
import { look_at } from '../../src/math/camera.ts';
import {
  empty_path,
  moved_keyframe,
  parse_path,
  rounded_path,
  total_seconds,
  with_keyframe,
  with_seconds,
  without_keyframe,
} from '../../src/math/keyframes.ts';
import { encoded } from '../../src/net/connection.ts';
import { near } from './near.ts';

const view = look_at([0, -2, 1], [0, 0, 0], [0, 0, 1], 30);
const path = [0.1, 0.2, 0.3].reduce((p, time) => with_keyframe(p, view, time), empty_path);
const times = (p: typeof path): number[] => p.keyframes.map((k) => k.time);

test('keyframes are added at the end and take over the last duration', () => {
  assert.deepEqual(times(path), [0.1, 0.2, 0.3]);
  const longer = with_keyframe(with_seconds(path, 2, 5), view, 0.4);
  assert.equal(longer.keyframes[3]?.seconds, 5);
  assert.equal(empty_path.keyframes.length, 0);
});

test('they can be taken away and put elsewhere', () => {
  assert.deepEqual(times(without_keyframe(path, 1)), [0.1, 0.3]);
  assert.deepEqual(times(moved_keyframe(path, 0, 2)), [0.2, 0.3, 0.1]);
  assert.deepEqual(times(moved_keyframe(path, 2, 1)), [0.1, 0.3, 0.2]);
  assert.equal(moved_keyframe(path, 0, -1), path);
  assert.equal(moved_keyframe(path, 2, 3), path);
});

test('the last duration counts only on a closed path', () => {
  const timed = with_seconds(with_seconds(with_seconds(path, 0, 1), 1, 2), 2, 4);
  assert.equal(total_seconds(timed), 3);
  assert.equal(total_seconds({ ...timed, closed: true }), 7);
  assert.equal(total_seconds(empty_path), 0);
});

test('a path survives its file', () => {
  const text = JSON.stringify({ ...path, closed: true });
  assert.equal(JSON.stringify(parse_path(text)), text);
});

test('rounding keeps nine digits of every number', () => {
  const odd = with_keyframe(path, { ...view, position: [1 / 3, -2e-7 / 3, 12345678.912345] }, 2 / 3);
  const [first, , , last] = rounded_path(odd).keyframes;
  assert.deepEqual(last?.position, [0.333333333, -6.66666667e-8, 12345678.9]);
  assert.equal(last?.time, 0.666666667);
  assert.deepEqual(rounded_path(rounded_path(odd)), rounded_path(odd));
  view.rotation.flat().forEach((x, i) => near(first?.rotation.flat()[i] ?? NaN, x, 1e-9));
});

test('a path of two hundred keyframes can be sent, one of a thousand cannot', () => {
  const of = (count: number): typeof path => ({
    ...path,
    keyframes: Array.from({ length: count }, (_, i) => ({ ...view, time: 0.5, seconds: 1 + i / 7 })),
  });
  const sent = encoded({ type: 'path', id: 1, path: rounded_path(of(200)) });
  assert.ok(sent !== null && sent.length > 20000);
  assert.equal(encoded({ type: 'path', id: 1, path: rounded_path(of(1000)) }), null);
});

test('the length of a message counts in bytes', () => {
  const view_request = (map: string): unknown => encoded({ ...({ type: 'view' } as ViewRequest), map });
  assert.notEqual(view_request('x'.repeat(65000)), null);
  assert.equal(view_request('€'.repeat(22000)), null);
});

test('a file that is none is refused in words', () => {
  const bad = (change: object): string => JSON.stringify({ ...path, ...change });
  const first = path.keyframes[0];
  for (const [text, words] of [
    ['{', /not JSON/],
    ['[]', /not a camera path/],
    [bad({ version: 2 }), /version 2/],
    [bad({ fps: 0 }), /frames per second/],
    [bad({ fps: 2000 }), /frames per second/],
    [bad({ width: null }), /width/],
    [bad({ height: 16385 }), /height/],
    [bad({ width: 10.5 }), /whole pixels/],
    [bad({ keyframes: {} }), /no keyframes/],
    [bad({ keyframes: [first, { ...first, position: [0, 1] }] }), /Keyframe 2 .* position/],
    [bad({ keyframes: [{ ...first, rotation: [[1, 0, 0]] }] }), /rotation/],
    [bad({ keyframes: [{ ...first, fov_y: 179.5 }] }), /fov_y of 0.1 to 179/],
    [bad({ keyframes: [{ ...first, fov_y: 0.05 }] }), /fov_y of 0.1 to 179/],
    [bad({ keyframes: [{ ...first, time: 1.5 }] }), /time from 0 to 1/],
    [bad({ keyframes: [{ ...first, seconds: -1 }] }), /seconds/],
    [bad({ keyframes: [{ ...first, seconds: 2e6 }] }), /0 to 1000000 seconds/],
    [bad({ keyframes: [3] }), /not an object/],
  ] as const) {
    assert.throws(() => parse_path(text), words);
  }
});
