import { still_side } from '../messages.ts';
import type { Picture } from '../net/wire.ts';
import { picture_blob } from '../net/wire.ts';
import { captured_view, hello, notify, pixel_ratio, server, stage, time } from './store.ts';
import { shown_layer } from '../stage/view_requests.ts';
import { fit, whole, type Size } from '../math/fit.ts';
import { file_name } from '../parts/format.ts';
import { computed, signal } from '@preact/signals';
import { send } from './server.ts';

// Screenshots: pictures that the server renders at a chosen size and the browser keeps as files.

export const still_sizes = ['1', '2', '4', 'capture'] as const;
export type StillSize = (typeof still_sizes)[number];
export const still_size = signal<StillSize>('1');
export const still_wanted = signal(0); // id of the one under way, 0 when there is none

const names = new Map<number, string>();
let next = 1;

const fits = ({ width, height }: Size): boolean => Math.max(width, height) <= still_side;

// In pixels; null where there is no such size, or the server does not make it.
export function size_of(choice: StillSize): Size | null {
  const view = captured_view.value ?? hello.value?.cameras.train[0] ?? hello.value?.cameras.test[0];
  if (choice === 'capture') return view && fits(view) ? { width: view.width, height: view.height } : null;
  const here = captured_view.value;
  const box = { width: stage.value.width * pixel_ratio.value, height: stage.value.height * pixel_ratio.value };
  const now = here ? fit(here.width / here.height, box) : box;
  const size = { width: now.width * Number(choice), height: now.height * Number(choice) };
  return choice === '1' || fits(size) ? whole(size, still_side) : null;
}

// The chosen size where there is such, or that of the stage.
export const chosen_size = computed((): StillSize => (size_of(still_size.value) ? still_size.value : '1'));

export function take_still(): void {
  const size = size_of(chosen_size.value);
  const there = hello.value;
  if (!size || !there || still_wanted.value !== 0) return;
  const id = next++;
  const when = there.moves ? `_t${time.value.toFixed(3)}` : '';
  const trained = server.value?.iterations ? `_${server.value.iteration}` : '';
  const where = captured_view.value ? `_${captured_view.value.id}` : '';
  names.set(
    id,
    file_name(`${there.name}${where}_${shown_layer()}${when}${trained}_${size.width}x${size.height}`) + '.png',
  );
  if (send({ type: 'still', id, ...size })) return void (still_wanted.value = id);
  names.delete(id);
  notify('There is no connection to the server.');
}

export function save_still(picture: Picture): void {
  if (picture.header.type !== 'still') return;
  const { id } = picture.header;
  save_file(picture_blob(picture), names.get(id) ?? 'traceflow.png');
  names.delete(id);
  if (still_wanted.value === id) still_wanted.value = 0;
}

// No answer will come.
export const give_up_still = (): void => void (still_wanted.value = 0);

export function save_file(content: Blob, name: string): void {
  const address = URL.createObjectURL(content);
  const anchor = document.createElement('a');
  anchor.href = address;
  anchor.download = name;
  anchor.click();
  setTimeout(() => URL.revokeObjectURL(address), 10000);
}
