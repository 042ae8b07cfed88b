import { signal } from '@preact/signals';
import type { ProbeReply, Vec3 } from '../messages.ts';
import type { Point } from '../math/camera.ts';
import { notify, rays_on, shown, stage } from './store.ts';
import { send } from './server.ts';

// Rays through the picture: where they meet the surface and what is mirrored there.

export type Ray = ProbeReply & { surface: Vec3; normal: Vec3 };

export const hovered = signal<Ray | null>(null);
export const pinned = signal<Ray[]>([]);

type Purpose = (reply: ProbeReply) => void;

const most_pinned = 24;
let next = 1;
const asked = new Map<number, Purpose>();
let under_way = 0; // id of the hover's probe, 0 when there is none
let waiting: Point | null = null; // the newest place of the cursor

const is_ray = (reply: ProbeReply): reply is Ray => reply.hit && !!reply.surface && !!reply.normal;

// Where a point of the stage (CSS pixels) is in the shown picture; null outside of it.
export function in_picture(x: number, y: number): Point | null {
  const place = shown.value?.place;
  if (!place) return null;
  const point = { x: (x - place.left) / place.width, y: (y - place.top) / place.height };
  const inside = point.x >= 0 && point.x <= 1 && point.y >= 0 && point.y <= 1;
  return inside && x >= 0 && y >= 0 && x <= stage.value.width && y <= stage.value.height ? point : null;
}

function ask(point: Point, purpose: Purpose): number {
  const id = next++;
  asked.set(id, purpose);
  return send({ type: 'probe', id, ...point }) ? id : 0;
}

export function take_probe(reply: ProbeReply): void {
  asked.get(reply.id)?.(reply);
  for (const id of asked.keys()) if (id <= reply.id) asked.delete(id);
}

// Follows the cursor, one probe at a time.
export function hover(point: Point | null): void {
  if (!rays_on.value) return;
  waiting = point;
  if (!point) {
    hovered.value = null;
    return;
  }
  if (under_way !== 0 && asked.has(under_way)) return;
  waiting = null;
  under_way = ask(point, (reply) => {
    under_way = 0;
    hovered.value = is_ray(reply) ? reply : null;
    if (waiting) hover(waiting);
  });
}

// Calls back with the surface at this point, or says that there is none.
export function find_surface(point: Point, found: (ray: Ray) => void): void {
  ask(point, (reply) => {
    if (is_ray(reply)) found(reply);
    else notify('There is no surface at this point.');
  });
}

export const pin = (point: Point): void =>
  find_surface(point, (ray) => (pinned.value = [...pinned.value.slice(1 - most_pinned), ray]));

export const unpin = (ray: Ray): void => void (pinned.value = pinned.value.filter((r) => r !== ray));
export const unpin_all = (): void => void (pinned.value = []);

export function forget_probes(): void {
  asked.clear();
  under_way = 0;
}

export function toggle_rays(): void {
  rays_on.value = !rays_on.value;
  if (!rays_on.value) hovered.value = null;
}
