import { computed, effect } from '@preact/signals';
import { moving } from '../stage/view_requests.ts';
import { hello, looping, playing, speed, time } from './store.ts';

// Time going on while the scene plays.

// Seconds that the whole of time lasts at speed 1: as a film of the captured instants at 15 a second.
export const lasting = computed(() => {
  const there = hello.value;
  const instants = new Set(there ? [...there.cameras.train, ...there.cameras.test].map((view) => view.time) : []);
  return Math.min(Math.max(instants.size / 15, 2), 30);
});

// One captured instant.
export const instant = computed(() => {
  const views = hello.value ? [...hello.value.cameras.train, ...hello.value.cameras.test] : [];
  const instants = new Set(views.map((view) => view.time)).size;
  return instants > 1 ? 1 / (instants - 1) : 1 / 60;
});

export const set_time = (to: number): void => moving(() => void (time.value = Math.min(Math.max(to, 0), 1)));

export function step_time(by: number): void {
  playing.value = false;
  set_time(time.value + by * instant.value);
}

export function toggle_playing(): void {
  if (!hello.value?.moves) return;
  if (!playing.value && time.value >= 1) time.value = 0;
  playing.value = !playing.value;
}

effect(() => {
  if (!playing.value) return;
  let handle = 0;
  let before = performance.now();
  const step = (now: number): void => {
    const passed = Math.min(Math.max(now - before, 0), 250) / 1000;
    before = now;
    const next = time.peek() + (passed * speed.peek()) / lasting.peek();
    set_time(next <= 1 ? next : looping.peek() ? next - 1 : 1);
    if (next > 1 && !looping.peek()) return void (playing.value = false);
    handle = requestAnimationFrame(step);
  };
  handle = requestAnimationFrame(step);
  return () => cancelAnimationFrame(handle);
});
