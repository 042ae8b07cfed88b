import { zoom_by, pan_by, turn_by } from './gestures.ts';
import { fly_key_down, fly_key_up, release_fly_keys } from './fly_keys.ts';
import { centre_on, reset_view } from './travel.ts';
import {
  comparison,
  hello,
  layer,
  mode,
  photo,
  playing,
  previewing,
  rays_on,
  shown,
  type Comparison,
} from '../state/store.ts';
import { step_camera } from '../state/cameras.ts';
import { step_time, toggle_playing } from '../state/clock.ts';
import { add_keyframe, toggle_preview } from '../state/path.ts';
import { choose_tab, help_open, status_open, tabs, toggle_panel } from '../state/panel.ts';
import { find_surface, pin, toggle_rays, unpin_all } from '../state/rays.ts';
import { take_still } from '../state/still.ts';
import { next_theme } from '../state/theme.ts';

export interface Key {
  shown: string; // in the list of keys
  does: string;
}

// In the order of the list.
export const key_list: { title: string; keys: Key[] }[] = [
  {
    title: 'Looking',
    keys: [
      { shown: 'Drag · ← ↑ → ↓', does: 'orbit, or look around when flying' },
      { shown: 'Right drag · Shift + arrows', does: 'pan' },
      { shown: 'Wheel · + −', does: 'come nearer, go farther' },
      { shown: 'W A S D · Q E', does: 'fly; with Shift faster' },
      { shown: 'F', does: 'orbit or fly' },
      { shown: 'Double click · O', does: 'orbit this point, the middle' },
      { shown: 'R', does: 'back to the start' },
    ],
  },
  {
    title: 'Seeing',
    keys: [
      { shown: '1 … 9, 0', does: 'layers' },
      { shown: 'M', does: 'paths of what moves, on and off' },
      { shown: 'Space', does: 'play or pause' },
      { shown: ', .', does: 'one instant back, on' },
      { shown: '[ ]', does: 'captured camera before, after' },
      { shown: 'C', does: 'next comparison with the photograph' },
      { shown: 'T', does: 'reflection rays; click or Enter pins one' },
      { shown: 'X', does: 'take the pinned rays away' },
    ],
  },
  {
    title: 'Making',
    keys: [
      { shown: 'K', does: 'add a keyframe' },
      { shown: 'P', does: 'preview the camera path' },
      { shown: 'G', does: 'screenshot' },
    ],
  },
  {
    title: 'Page',
    keys: [
      { shown: 'V', does: 'next tab of the panel' },
      { shown: '\\', does: 'panel' },
      { shown: 'I', does: 'status' },
      { shown: 'L', does: 'light, dark or as the system' },
      { shown: '?', does: 'this list' },
    ],
  },
];

const middle = { x: 0.5, y: 0.5 };
const order: Comparison[] = ['render', 'split', 'photo', 'difference'];
const arrows: Record<string, [number, number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
};

// Back to the layer before.
let without_tracks = 'rgb';
function toggle_tracks(): void {
  if (!hello.value?.layers.some((l) => l.name === 'tracks')) return;
  if (layer.value !== 'tracks') without_tracks = layer.value;
  layer.value = layer.value === 'tracks' ? without_tracks : 'tracks';
}

const actions: Record<string, () => void> = {
  '+': () => zoom_by(0.9),
  '=': () => zoom_by(0.9),
  '-': () => zoom_by(1 / 0.9),
  f: () => (mode.value = mode.value === 'orbit' ? 'fly' : 'orbit'),
  o: () => find_surface(middle, (ray) => centre_on(ray.surface)),
  r: reset_view,
  ' ': toggle_playing,
  ',': () => step_time(-1),
  '.': () => step_time(1),
  '[': () => step_camera(-1),
  ']': () => step_camera(1),
  c: () => {
    if (photo.value) comparison.value = order[(order.indexOf(comparison.value) + 1) % order.length] ?? 'render';
  },
  m: toggle_tracks,
  t: toggle_rays,
  x: unpin_all,
  k: add_keyframe,
  p: toggle_preview,
  g: take_still,
  v: next_tab,
  '\\': toggle_panel,
  i: () => (status_open.value = !status_open.value),
  l: next_theme,
  '?': () => (help_open.value = !help_open.value),
  Escape: () => {
    help_open.value = previewing.value = playing.value = false;
  },
};

function next_tab(): void {
  const current = document.querySelector('[role=tab][aria-selected=true]')?.getAttribute('data-tab');
  choose_tab(tabs[(tabs.findIndex((t) => t === current) + 1) % tabs.length] ?? 'view');
}

// Whether the focused element needs this key itself.
function is_taken(event: KeyboardEvent): boolean {
  const target = event.target;
  if (!(target instanceof HTMLElement)) return false;
  if (target.closest('dialog')) return event.key !== '?';
  if (target instanceof HTMLSelectElement || target instanceof HTMLTextAreaElement) return true;
  if (target instanceof HTMLInputElement) {
    if (target.type === 'range') return event.key.startsWith('Arrow');
    if (target.type === 'radio') return event.key.startsWith('Arrow') || event.key === ' ';
    return target.type === 'checkbox' ? event.key === ' ' : true;
  }
  if (target instanceof HTMLButtonElement) return event.key === ' ' || event.key === 'Enter';
  return target.getAttribute('role') === 'tab' && event.key.startsWith('Arrow');
}

function on_key(event: KeyboardEvent): void {
  if (event.ctrlKey || event.metaKey || event.altKey || is_taken(event)) return;
  if (press(event)) event.preventDefault();
}

function press(event: KeyboardEvent): boolean {
  if (!hello.value && event.key !== '?') return false;
  if (fly_key_down(event)) return true;
  const arrow = arrows[event.key];
  if (arrow) {
    if (event.shiftKey) pan_by(arrow[0] * -24, arrow[1] * -24);
    else turn_by(arrow[0] * 24, arrow[1] * 24);
    return true;
  }
  if (/^[0-9]$/.test(event.key)) {
    const layers = hello.value?.layers.filter((l) => l.name !== 'difference') ?? [];
    layer.value = layers[(Number(event.key) + 9) % 10]?.name ?? layer.value;
    return true;
  }
  if (event.key === 'Enter' && rays_on.value && shown.value) {
    pin(middle);
    return true;
  }
  const action = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  action?.();
  return action !== undefined;
}

export function listen_to_keys(): () => void {
  window.addEventListener('keydown', on_key);
  window.addEventListener('keyup', fly_key_up);
  window.addEventListener('blur', release_fly_keys);
  return () => {
    window.removeEventListener('keydown', on_key);
    window.removeEventListener('keyup', fly_key_up);
    window.removeEventListener('blur', release_fly_keys);
  };
}
