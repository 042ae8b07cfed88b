import { fly } from '../math/navigate.ts';
import { hello, mode } from '../state/store.ts';
import { steer } from './travel.ts';

// Keys that are held to fly: W A S D along the view and sideways, E and Q up and down, shift faster.

const directions: Record<string, [number, number, number]> = {
  KeyW: [0, 0, 1],
  KeyS: [0, 0, -1],
  KeyD: [1, 0, 0],
  KeyA: [-1, 0, 0],
  KeyE: [0, 1, 0],
  KeyQ: [0, -1, 0],
};

const held = new Set<string>();
let fast = false;
let before = 0;
let running = false;

// Whether the key was taken.
export function fly_key_down(event: KeyboardEvent): boolean {
  if (!(event.code in directions)) return false;
  mode.value = 'fly';
  fast = event.shiftKey;
  held.add(event.code);
  if (!running) {
    running = true;
    before = performance.now();
    requestAnimationFrame(step);
  }
  return true;
}

export function fly_key_up(event: KeyboardEvent): void {
  held.delete(event.code);
  fast = event.shiftKey;
}

export const release_fly_keys = (): void => held.clear();

function step(now: number): void {
  running = held.size > 0;
  if (!running) return;
  const length = ((hello.value?.extent ?? 1) * (fast ? 1.2 : 0.35) * Math.min(Math.max(now - before, 0), 100)) / 1000;
  before = now;
  const [right, rise, ahead] = [...held].reduce(
    (sum, key) => sum.map((value, i) => value + (directions[key]?.[i] ?? 0)) as [number, number, number],
    [0, 0, 0] as [number, number, number],
  );
  if (right || rise || ahead) steer((view, up) => fly(view, up, right * length, rise * length, ahead * length));
  requestAnimationFrame(step);
}
