import type { Camera, Vec3 } from '../messages.ts';
import { apply, from_columns, transpose } from './rotation.ts';
import { add, add_scaled, any_normal_to, cross, mix, subtract, unit } from './vec.ts';

export interface Point {
  x: number; // 0 (left of the picture) to 1
  y: number; // 0 (top) to 1
}

export const radians = (degrees: number): number => (degrees * Math.PI) / 180;
export const degrees = (angle: number): number => (angle * 180) / Math.PI;

const column = (c: Camera, i: 0 | 1 | 2): Vec3 => [c.rotation[0][i], c.rotation[1][i], c.rotation[2][i]];
export const right_of = (c: Camera): Vec3 => column(c, 0);
export const down_of = (c: Camera): Vec3 => column(c, 1);
export const forward_of = (c: Camera): Vec3 => column(c, 2);
const half_height = (c: Camera): number => Math.tan(radians(c.fov_y) / 2); // of the picture, one unit away

export function look_at(position: Vec3, target: Vec3, up: Vec3, fov_y: number): Camera {
  const forward = unit(subtract(target, position));
  const right = unit(cross(forward, up), any_normal_to(forward));
  return { position, rotation: from_columns(right, cross(forward, right), forward), fov_y };
}

const to_camera = (c: Camera, point: Vec3): Vec3 => apply(transpose(c.rotation), subtract(point, c.position));

function on_picture(c: Camera, aspect: number, [x, y, z]: Vec3): Point {
  const h = half_height(c) * z;
  return { x: 0.5 + x / (2 * h * aspect), y: 0.5 + y / (2 * h) };
}

// Where a point of the world is in the picture, which may be outside of it; null behind the camera.
export function project(c: Camera, aspect: number, point: Vec3): Point | null {
  const seen = to_camera(c, point);
  return seen[2] > 1e-6 ? on_picture(c, aspect, seen) : null;
}

// The part of a line in front of the camera; null where none is. `near` is a depth, in units of length.
export function project_line(c: Camera, aspect: number, a: Vec3, b: Vec3, near: number): [Point, Point] | null {
  let p = to_camera(c, a);
  let q = to_camera(c, b);
  if (p[2] < near && q[2] < near) return null;
  const cut = mix(p, q, (near - p[2]) / (q[2] - p[2]));
  if (p[2] < near) p = cut;
  else if (q[2] < near) q = cut;
  return [on_picture(c, aspect, p), on_picture(c, aspect, q)];
}

// Unit direction in the world of the ray through a point of the picture.
export function ray_through(c: Camera, aspect: number, point: Point): Vec3 {
  const h = half_height(c);
  return unit(apply(c.rotation, [(2 * point.x - 1) * h * aspect, (2 * point.y - 1) * h, 1]));
}

// The same place with an angle that keeps what a square picture shows inside a narrower one.
export function widened(c: Camera, aspect: number): Camera {
  if (aspect >= 1) return c;
  return { ...c, fov_y: degrees(2 * Math.atan(half_height(c) / aspect)) };
}

// Corners of the picture `depth` in front of the camera, around.
export function frustum(c: Camera, aspect: number, depth: number): [Vec3, Vec3, Vec3, Vec3] {
  const h = half_height(c) * depth;
  const corner = (x: number, y: number): Vec3 =>
    add(c.position, add_scaled(apply(c.rotation, [x * h * aspect, y * h, 0]), forward_of(c), depth));
  return [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)];
}
