import { computed, signal } from '@preact/signals';
import type { PhotoRef } from '../messages.ts';
import { go_to_photo } from '../stage/travel.ts';
import { hello, photo } from './store.ts';

// The list of captured cameras that the panel shows, and steps along it.

export const split = signal<PhotoRef['split']>('test');
export const listed = computed(() => hello.value?.cameras[split.value] ?? []);

let towards = -1; // the last camera that was gone to, so that quick steps add up

export function go_to(index: number): void {
  if (!listed.value[index]) return;
  towards = index;
  go_to_photo({ split: split.value, index });
}

export function step_camera(by: number): void {
  const count = listed.value.length;
  if (count === 0) return;
  const from = photo.value?.split === split.value ? photo.value.index : towards;
  go_to(from < 0 ? 0 : (from + by + count) % count);
}
