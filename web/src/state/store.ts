import { computed, signal } from '@preact/signals';
import type { Camera, CapturedView, Hello, PhotoRef, State, TrainingEvent, Vec3 } from '../messages.ts';
import type { Lens } from '../math/camera.ts';
import type { Rectangle, Size } from '../math/fit.ts';
import type { Link } from '../net/connection.ts';

// What the page knows and what its user wants. Everything on the screen follows from these.

// What the server says.
export const link = signal<Link>({ kind: 'connecting', again: false });
export const hello = signal<Hello | null>(null);
export const server = signal<State | null>(null);
export const warning = signal('');
export const notices = signal<{ key: number; text: string }[]>([]);
export const events = signal<TrainingEvent[]>([]);

// What is looked at, and from where.
export const camera = signal<Camera | null>(null); // of a picture at least as wide as high
export const pivot = signal<Vec3>([0, 0, 0]);
export const photo = signal<PhotoRef | null>(null); // the captured camera that is looked from
export const time = signal(0);
export const layer = signal('rgb');
export const exposure = signal(0);
export const map = signal('');
export const asleep = signal(document.hidden);

// How its user looks: what the tools are set to.
export type Mode = 'orbit' | 'fly';
export const mode = signal<Mode>('orbit');
export const rays_on = signal(false);
export type Comparison = 'render' | 'split' | 'photo' | 'difference';
export const comparison = signal<Comparison>('split'); // wanted at captured cameras
export const split_at = signal(0.5); // share of the picture's width that is photograph
export const playing = signal(false);
export const previewing = signal(false); // of the camera path
export const speed = signal(1);
export const looping = signal(true);

export const stage = signal<Size>({ width: 1, height: 1 }); // CSS pixels
export const pixel_ratio = signal(1); // device pixels to a CSS pixel, at most 2

// What the canvas shows: whose camera it has, and where on the stage it is.
export interface Shown {
  camera: Lens; // as it was sent
  photo: PhotoRef | null;
  aspect: number;
  place: Rectangle; // CSS pixels
  time: number;
  frame: number;
}
export const shown = signal<Shown | null>(null);

export const captured = (ref: PhotoRef | null): CapturedView | null =>
  ref ? (hello.value?.cameras[ref.split][ref.index] ?? null) : null;
export const captured_view = computed(() => captured(photo.value));
// Whether the photograph of the captured camera is of the time that is looked at.
export const comparable = computed(() => {
  const view = captured_view.value;
  return view !== null && Math.abs(view.time - time.value) < 1e-6;
});
// What the stage shows of it now.
export const comparing = computed((): Comparison => (comparable.value ? comparison.value : 'render'));
export const training = computed(() => hello.value?.source === 'training' && server.value?.over === false);

let keys = 0;
export function notify(text: string): void {
  const key = keys++;
  notices.value = [...notices.peek().slice(-2), { key, text }]; // effects may notify
  setTimeout(() => (notices.value = notices.value.filter((n) => n.key !== key)), 6000);
}
