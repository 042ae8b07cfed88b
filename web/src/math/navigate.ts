import type { Camera, Vec3 } from '../messages.ts';
import { down_of, forward_of, look_at, radians, right_of } from './camera.ts';
import { about, apply, multiply, orthonormal } from './rotation.ts';
import { add, add_scaled, any_normal_to, clamp, cross, distance, dot, scale, subtract, unit } from './vec.ts';

// A camera and the point that it orbits.
export interface Viewpoint {
  camera: Camera;
  pivot: Vec3;
}

const steepest = radians(2); // nearest that a view direction comes to straight up or down

// How far the view may pitch (radians, positive looks down) before it points straight up or down.
function allowed_pitch(camera: Camera, up: Vec3, pitch: number): number {
  const from_up = Math.acos(clamp(dot(forward_of(camera), up), -1, 1));
  return clamp(from_up + pitch, Math.min(steepest, from_up), Math.max(Math.PI - steepest, from_up)) - from_up;
}

// The horizontal axis at right angles to the view: pitching about it leaves a tilted camera as tilted as it is.
const level_axis = (camera: Camera, up: Vec3): Vec3 =>
  unit(cross(forward_of(camera), up), any_normal_to(forward_of(camera)));

function turned(camera: Camera, centre: Vec3, up: Vec3, yaw: number, pitch: number): Camera {
  const turn = multiply(about(up, -yaw), about(level_axis(camera, up), -allowed_pitch(camera, up, pitch)));
  return {
    ...camera,
    position: add(centre, apply(turn, subtract(camera.position, centre))),
    rotation: orthonormal(multiply(turn, camera.rotation)),
  };
}

// Turns the camera about the pivot, which stays where it is in the picture. Angles in radians.
export function orbit({ camera, pivot }: Viewpoint, up: Vec3, yaw: number, pitch: number): Viewpoint {
  return { camera: turned(camera, pivot, up, yaw, pitch), pivot };
}

// Turns the camera where it stands: yaw to the right, pitch down, in radians.
export function look_around({ camera, pivot }: Viewpoint, up: Vec3, yaw: number, pitch: number): Viewpoint {
  const after = turned(camera, camera.position, up, yaw, pitch);
  return { camera: after, pivot: add_scaled(after.position, forward_of(after), distance(camera.position, pivot)) };
}

const moved = ({ camera, pivot }: Viewpoint, by: Vec3): Viewpoint => ({
  camera: { ...camera, position: add(camera.position, by) },
  pivot: add(pivot, by),
});

// Shifts the camera so that the pivot moves by this share of the picture's height.
export function pan(view: Viewpoint, x: number, y: number): Viewpoint {
  const { camera, pivot } = view;
  const depth = Math.max(dot(subtract(pivot, camera.position), forward_of(camera)), 1e-6);
  const size = 2 * depth * Math.tan(radians(camera.fov_y) / 2);
  return moved(view, add(scale(right_of(camera), -x * size), scale(down_of(camera), -y * size)));
}

// Multiplies the distance to the pivot, between `nearest` and `farthest`.
export function zoom({ camera, pivot }: Viewpoint, factor: number, nearest: number, farthest: number): Viewpoint {
  const before = Math.max(distance(camera.position, pivot), 1e-9);
  const low = Math.min(nearest, before);
  const high = Math.max(farthest, before);
  const after = clamp(before * factor, low, high);
  const position = add_scaled(pivot, subtract(camera.position, pivot), after / before);
  return { camera: { ...camera, position }, pivot };
}

// Moves by lengths along the camera's right, the world's up and the camera's forward.
export function fly(view: Viewpoint, up: Vec3, right: number, rise: number, ahead: number): Viewpoint {
  const sideways = add(scale(right_of(view.camera), right), scale(up, rise));
  return moved(view, add_scaled(sideways, forward_of(view.camera), ahead));
}

// Turns to have the pivot in the middle of the picture.
export function centred({ camera, pivot }: Viewpoint, up: Vec3): Viewpoint {
  return { camera: look_at(camera.position, pivot, up, camera.fov_y), pivot };
}
