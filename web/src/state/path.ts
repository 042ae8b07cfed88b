import { effect, signal, untracked } from '@preact/signals';
import type { CameraPath, PathReply } from '../messages.ts';
import { empty_path, parse_path, rounded_path, with_keyframe } from '../math/keyframes.ts';
import { file_name } from '../parts/format.ts';
import { moving } from '../stage/view_requests.ts';
import { stop_flight } from '../stage/travel.ts';
import { send } from './server.ts';
import { save_file } from './still.ts';
import { camera, hello, link, notify, photo, playing, previewing, time } from './store.ts';

// The camera path that is being made, kept by the browser for each run.

export const path = signal<CameraPath>(empty_path);
export const shots = signal<PathReply['shots']>([]); // along it, for as long as it is what they were asked for
export const path_visible = signal(false); // whether it is drawn into the scene

const key = (run: string): string => `traceflow path ${run}`;
let asked = 0; // id of the newest request for shots
let loaded = ''; // the run whose path this is

effect(() => {
  const run = hello.value?.name;
  if (run === undefined || run === loaded) return;
  loaded = run;
  path.value = recall(run);
});

effect(() => {
  const now = path.value;
  if (!loaded) return;
  try {
    localStorage.setItem(key(loaded), JSON.stringify(now));
  } catch {
    // Without storage the path lasts as long as the page.
  }
});

// The server knows the way between keyframes: it is asked anew whenever they change.
effect(() => {
  const now = path.value;
  if (link.value.kind !== 'open' || !hello.value) return;
  const sent = now.keyframes.length > 1 && send({ type: 'path', id: ++asked, path: rounded_path(now) });
  if (!sent) shots.value = [];
});

function recall(run: string): CameraPath {
  try {
    const text = localStorage.getItem(key(run));
    return text ? parse_path(text) : empty_path;
  } catch {
    return empty_path;
  }
}

export function take_path(reply: PathReply): void {
  if (reply.id === asked) shots.value = reply.shots;
}

// There is no way along this path.
export function refuse_path(id: number): void {
  if (id === asked) shots.value = [];
}

export function add_keyframe(): void {
  const here = camera.value;
  if (!here) return;
  path.value = with_keyframe(path.value, here, time.value);
  path_visible.value = true;
}

export function export_path(): void {
  const text = JSON.stringify(rounded_path(path.value), null, 2) + '\n';
  save_file(new Blob([text], { type: 'application/json' }), `${file_name(hello.value?.name ?? '')}_path.json`);
}

export async function import_path(file: File): Promise<void> {
  try {
    path.value = parse_path(await file.text());
    path_visible.value = true;
  } catch (error) {
    notify(error instanceof Error ? error.message : 'This file could not be read.');
  }
}

export function toggle_preview(): void {
  if (previewing.value) return void (previewing.value = false);
  if (shots.value.length === 0) return notify('A path needs two keyframes.');
  stop_flight();
  playing.value = false;
  photo.value = null;
  previewing.value = true;
}

// Goes along the shots at the path's own speed, showing as many of them as come through.
effect(() => {
  if (!previewing.value) return;
  let handle = 0;
  let start = 0;
  const step = (now: number): void => {
    start ||= now;
    const list = shots.peek();
    const { fps, closed } = path.peek();
    const index = Math.max(0, Math.floor(((now - start) / 1000) * fps));
    const shot = list[closed ? index % Math.max(list.length, 1) : Math.min(index, list.length - 1)];
    if (!shot || photo.peek()) return void (previewing.value = false);
    moving(() => {
      camera.value = shot.camera;
      time.value = shot.time;
    });
    if (!closed && index >= list.length - 1) return void (previewing.value = false);
    handle = requestAnimationFrame(step);
  };
  untracked(() => (handle = requestAnimationFrame(step)));
  return () => cancelAnimationFrame(handle);
});
