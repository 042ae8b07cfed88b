import type { Camera, Vec3 } from '../messages.ts';
import { slerp } from './rotation.ts';
import { add, add_scaled, clamp, cross, distance, dot, length, mix, scale, subtract, unit } from './vec.ts';

// Slow at both ends.
export const eased = (t: number): number => t * t * (3 - 2 * t);

// Between two directions at constant speed; straight where they are opposed.
function between_directions(a: Vec3, b: Vec3, t: number): Vec3 {
  const angle = Math.acos(clamp(dot(a, b), -1, 1));
  if (angle < 1e-4) return unit(mix(a, b, t), a);
  if (angle > Math.PI - 1e-3) return unit(add_scaled(scale(a, Math.cos(angle * t)), sideways(a), Math.sin(angle * t)));
  return add_scaled(scale(a, Math.sin((1 - t) * angle) / Math.sin(angle)), b, Math.sin(t * angle) / Math.sin(angle));
}

const sideways = (a: Vec3): Vec3 => unit(cross(a, [0.3, 0.9, 0.1]), [1, 0, 0]);

// A camera on the way from one to another, around `centre` rather than through it.
export function between(from: Camera, to: Camera, centre: Vec3, t: number): Camera {
  const a = subtract(from.position, centre);
  const b = subtract(to.position, centre);
  const around = length(a) > 1e-9 && length(b) > 1e-9;
  const position = around
    ? add(centre, scale(between_directions(unit(a), unit(b), t), length(a) ** (1 - t) * length(b) ** t))
    : mix(from.position, to.position, t);
  return {
    position,
    rotation: slerp(from.rotation, to.rotation, t),
    fov_y: from.fov_y + (to.fov_y - from.fov_y) * t,
  };
}

// How long a flight should take, in milliseconds.
export function flight_time(from: Camera, to: Camera, extent: number): number {
  return clamp(350 + (500 * distance(from.position, to.position)) / Math.max(extent, 1e-9), 350, 900);
}
