import { batch } from '@preact/signals';
import type { Camera, PhotoRef, Vec3 } from '../messages.ts';
import { between, eased, flight_time } from '../math/flight.ts';
import { centred, type Viewpoint } from '../math/navigate.ts';
import { camera, captured, hello, photo, pivot, previewing, time } from '../state/store.ts';
import { look_from_start } from '../state/server.ts';
import { moving } from './view_requests.ts';

// Ways of the camera: by hand at once, and to named places by a flight.

let flight = 0; // handle of the next step, 0 when none is under way

const calm = window.matchMedia('(prefers-reduced-motion: reduce)');

export function stop_flight(): void {
  cancelAnimationFrame(flight);
  flight = 0;
}

// Moves the camera by hand, which ends flights and leaves the captured camera.
export function steer(change: (view: Viewpoint, up: Vec3) => Viewpoint): void {
  const there = hello.value;
  const from = camera.value;
  if (!there || !from) return;
  stop_flight();
  moving(() => {
    previewing.value = false;
    photo.value = null;
    const after = change({ camera: from, pivot: pivot.value }, there.up);
    camera.value = after.camera;
    pivot.value = after.pivot;
  });
}

// Flies there, and does `arrived` in the end.
export function fly_to(to: Camera, at_time: number, arrived: () => void = () => undefined): void {
  const there = hello.value;
  const from = camera.value;
  if (!there || !from) return;
  stop_flight();
  previewing.value = false;
  photo.value = null;
  const from_time = time.value;
  const lasts = calm.matches ? 0 : flight_time(from, to, there.extent);
  const start = performance.now();
  const step = (now: number): void => {
    const share = lasts > 0 ? Math.min(Math.max((now - start) / lasts, 0), 1) : 1;
    const t = eased(share);
    moving(() => {
      camera.value = share < 1 ? between(from, to, there.target, t) : to;
      time.value = share < 1 ? from_time + (at_time - from_time) * t : at_time;
    });
    flight = share < 1 ? requestAnimationFrame(step) : 0;
    if (share === 1) arrived();
  };
  step(start);
}

export function go_to_photo(ref: PhotoRef): void {
  const view = captured(ref);
  const there = hello.value;
  if (!view || !there) return;
  fly_to({ position: view.position, rotation: view.rotation, fov_y: view.fov_y }, view.time, () =>
    batch(() => {
      photo.value = ref;
      pivot.value = there.target;
    }),
  );
}

export function reset_view(): void {
  const there = hello.value;
  if (!there) return;
  fly_to(there.start, time.value, look_from_start);
}

// Makes a point of the scene the one that is orbited, in the middle of the picture.
export function centre_on(point: Vec3): void {
  const there = hello.value;
  const from = camera.value;
  if (!there || !from) return;
  const after = centred({ camera: from, pivot: point }, there.up);
  fly_to(after.camera, time.value, () => (pivot.value = point));
}
