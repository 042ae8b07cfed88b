import assert from 'node:assert/strict';
import type { Vec3 } from '../../src/messages.ts';

export function near(found: number, expected: number, tolerance = 1e-9): void {
  assert.ok(Math.abs(found - expected) <= tolerance, `${found} is not ${expected}`);
}

export function near_vector(found: readonly number[], expected: readonly number[], tolerance = 1e-9): void {
  assert.equal(found.length, expected.length);
  found.forEach((x, i) => near(x, expected[i] ?? NaN, tolerance));
}

// Repeatable numbers between −1 and 1.
export function numbers(seed: number): () => number {
  let state = seed;
  return () => {
    state = (state * 1103515245 + 12345) % 2147483648;
    return state / 1073741824 - 1;
  };
}

export const vector = (next: () => number): Vec3 => [next(), next(), next()];
