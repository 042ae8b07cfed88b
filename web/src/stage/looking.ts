import { batch, effect } from '@preact/signals';
import type { Look } from '../messages.ts';
import { fit, whole } from '../math/fit.ts';
import { widened } from '../math/camera.ts';
import {
  asleep,
  camera,
  captured,
  comparing,
  exposure,
  hello,
  layer,
  map,
  photo,
  pixel_ratio,
  stage,
  time,
} from '../state/store.ts';
import { send } from '../state/server.ts';
import { Looker, type Wish } from './looker.ts';

export const looker = new Looker((look: Look) => send(look), {
  now: () => performance.now(),
  after: (milliseconds, f) => void setTimeout(f, milliseconds),
});

// Device pixels of the stage.
const pixels = () => ({ width: stage.value.width * pixel_ratio.value, height: stage.value.height * pixel_ratio.value });

export const shown_layer = (): string => (comparing.value === 'difference' ? 'difference' : layer.value);

// What the signals of the store ask to see; null before there is anything to see.
export function current_wish(): Wish | null {
  const there = hello.value;
  const free = camera.value;
  if (!there || !free || stage.value.width < 2 || stage.value.height < 2) return null;
  const view = captured(photo.value);
  const box = pixels();
  const common = { time: time.value, layer: shown_layer(), exposure: exposure.value, map: map.value };
  if (view && photo.value) return { photo: photo.value, ...whole(fit(view.width / view.height, box)), ...common };
  return { camera: widened(free, box.width / box.height), ...whole(box), ...common };
}

export function start_looking(): void {
  effect(() => {
    const wish = current_wish();
    if (wish && !asleep.value) looker.want(wish);
  });
  effect(() => {
    if (asleep.value) send({ type: 'sleep' });
  });
  document.addEventListener('visibilitychange', () => (asleep.value = document.hidden));
}

// Changes what is looked at by input that goes on, such as a drag.
export function moving(change: () => void): void {
  looker.motion();
  batch(change);
}
