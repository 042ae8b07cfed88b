import assert from 'node:assert/strict';
import { test } from 'node:test';
import { look_at } from '../../src/math/camera.ts';
import {
  empty_path,
  moved_keyframe,
  parse_path,
  total_seconds,
  with_keyframe,
  with_seconds,
  without_keyframe,
} from '../../src/math/keyframes.ts';

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

test('a file that is none is refused in words', () => {
  const bad = (change: object): string => JSON.stringify({ ...path, ...change });
  const first = path.keyframes[0];
  for (const [text, words] of [
    ['{', /not JSON/],
    ['[]', /not a camera path/],
    [bad({ version: 2 }), /version 2/],
    [bad({ fps: 0 }), /frames per second/],
    [bad({ width: null }), /no size/],
    [bad({ keyframes: {} }), /no keyframes/],
    [bad({ keyframes: [first, { ...first, position: [0, 1] }] }), /Keyframe 2 .* position/],
    [bad({ keyframes: [{ ...first, rotation: [[1, 0, 0]] }] }), /rotation/],
    [bad({ keyframes: [{ ...first, fov_y: 180 }] }), /fov_y/],
    [bad({ keyframes: [{ ...first, time: 1.5 }] }), /time from 0 to 1/],
    [bad({ keyframes: [{ ...first, seconds: -1 }] }), /seconds/],
    [bad({ keyframes: [3] }), /not an object/],
  ] as const) {
    assert.throws(() => parse_path(text), words);
  }
});
