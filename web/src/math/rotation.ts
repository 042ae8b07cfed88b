import type { Vec3 } from '../messages.ts';
import { cross, dot, scale, unit } from './vec.ts';

export type Mat3 = [Vec3, Vec3, Vec3]; // rows
export type Quaternion = [number, number, number, number]; // w, x, y, z; unit

export const apply = (m: Mat3, v: Vec3): Vec3 => [dot(m[0], v), dot(m[1], v), dot(m[2], v)];
export const transpose = (m: Mat3): Mat3 => from_columns(m[0], m[1], m[2]);

export const from_columns = (a: Vec3, b: Vec3, c: Vec3): Mat3 => [
  [a[0], b[0], c[0]],
  [a[1], b[1], c[1]],
  [a[2], b[2], c[2]],
];

export function multiply(a: Mat3, b: Mat3): Mat3 {
  const columns = transpose(b);
  const row = (r: Vec3): Vec3 => [dot(r, columns[0]), dot(r, columns[1]), dot(r, columns[2])];
  return [row(a[0]), row(a[1]), row(a[2])];
}

// Turns by `angle` (radians, right-handed) about a unit axis.
export function about(axis: Vec3, angle: number): Mat3 {
  const half = angle / 2;
  const [x, y, z] = scale(axis, Math.sin(half));
  return to_matrix([Math.cos(half), x, y, z]);
}

// The nearest rotation to one that has drifted by rounding.
export function orthonormal(m: Mat3): Mat3 {
  const [right, , forward] = transpose(m);
  const z = unit(forward);
  const y = unit(cross(z, right));
  return from_columns(cross(y, z), y, z);
}

export function to_matrix([w, x, y, z]: Quaternion): Mat3 {
  return [
    [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
    [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
    [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
  ];
}

export function to_quaternion(m: Mat3): Quaternion {
  const [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = m;
  const trace = xx + yy + zz;
  if (trace > 0) {
    const s = 2 * Math.sqrt(1 + trace);
    return [s / 4, (zy - yz) / s, (xz - zx) / s, (yx - xy) / s];
  }
  if (xx > yy && xx > zz) {
    const s = 2 * Math.sqrt(1 + xx - yy - zz);
    return [(zy - yz) / s, s / 4, (xy + yx) / s, (xz + zx) / s];
  }
  if (yy > zz) {
    const s = 2 * Math.sqrt(1 + yy - xx - zz);
    return [(xz - zx) / s, (xy + yx) / s, s / 4, (yz + zy) / s];
  }
  const s = 2 * Math.sqrt(1 + zz - xx - yy);
  return [(yx - xy) / s, (xz + zx) / s, (yz + zy) / s, s / 4];
}

// From a (t = 0) to b (t = 1) the short way, at constant speed.
export function slerp(a: Mat3, b: Mat3, t: number): Mat3 {
  const p = to_quaternion(a);
  const q = to_quaternion(b);
  const cosine = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3];
  const angle = Math.acos(Math.min(Math.abs(cosine), 1));
  const near = angle < 1e-5;
  const from = near ? 1 - t : Math.sin((1 - t) * angle) / Math.sin(angle);
  const to = (near ? t : Math.sin(t * angle) / Math.sin(angle)) * (cosine < 0 ? -1 : 1);
  const mixed = p.map((value, i) => from * value + to * (q[i] ?? 0));
  const size = Math.hypot(...mixed);
  const [w = 1, x = 0, y = 0, z = 0] = mixed.map((value) => value / size);
  return to_matrix([w, x, y, z]);
}
