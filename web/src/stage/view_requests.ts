import { batch, effect } from '@preact/signals';
import { view_side, type ViewRequest } from '../messages.ts';
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
import { ViewRequester, type WantedView } from './view_requester.ts';

export const view_requester = new ViewRequester((view: ViewRequest) => send(view), {
  now: () => performance.now(),
  after: (milliseconds, f) => void setTimeout(f, milliseconds),
});

// Device pixels of the stage.
const pixels = () => ({ width: stage.value.width * pixel_ratio.value, height: stage.value.height * pixel_ratio.value });

export const shown_layer = (): string => (comparing.value === 'difference' ? 'difference' : layer.value);

// The view that the signals of the store ask for; null before there is anything to see.
export function wanted_view(): WantedView | null {
  const there = hello.value;
  const free = camera.value;
  if (!there || !free || stage.value.width < 2 || stage.value.height < 2) return null;
  const view = captured(photo.value);
  const box = pixels();
  const common = { time: time.value, layer: shown_layer(), exposure: exposure.value, map: map.value };
  if (view && photo.value)
    return { photo: photo.value, ...whole(fit(view.width / view.height, box), view_side), ...common };
  return { camera: widened(free, box.width / box.height), ...whole(box, view_side), ...common };
}

export function start_requesting_views(): void {
  effect(() => {
    const view = wanted_view();
    view_requester.sleep(asleep.value);
    if (view && !asleep.value) view_requester.want(view);
  });
  effect(() => {
    if (asleep.value) send({ type: 'sleep' });
  });
  document.addEventListener('visibilitychange', () => (asleep.value = document.hidden));
}

// Changes what is looked at by input that goes on, such as a drag.
export function moving(change: () => void): void {
  view_requester.motion();
  batch(change);
}
