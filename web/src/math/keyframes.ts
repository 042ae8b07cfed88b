import type { Camera, CameraPath, Keyframe, Vec3 } from '../messages.ts';

// What can be done to a camera path, as functions from a path to a path.

export const empty_path: CameraPath = {
  format: 'traceflow camera path',
  version: 1,
  width: 1280,
  height: 720,
  fps: 30,
  closed: false,
  keyframes: [],
};

export function with_keyframe(path: CameraPath, { position, rotation, fov_y }: Camera, time: number): CameraPath {
  const seconds = path.keyframes.at(-1)?.seconds ?? 2;
  return { ...path, keyframes: [...path.keyframes, { position, rotation, fov_y, time, seconds }] };
}

export const without_keyframe = (path: CameraPath, index: number): CameraPath => ({
  ...path,
  keyframes: path.keyframes.filter((_, i) => i !== index),
});

// Takes a keyframe to another place in the list; a place outside of it leaves the path as it is.
export function moved_keyframe(path: CameraPath, from: number, to: number): CameraPath {
  const keyframe = path.keyframes[from];
  if (!keyframe || to < 0 || to >= path.keyframes.length) return path;
  const others = path.keyframes.filter((_, i) => i !== from);
  return { ...path, keyframes: [...others.slice(0, to), keyframe, ...others.slice(to)] };
}

export const with_seconds = (path: CameraPath, index: number, seconds: number): CameraPath => ({
  ...path,
  keyframes: path.keyframes.map((k, i) => (i === index ? { ...k, seconds } : k)),
});

// The last keyframe's duration counts only where the path goes back to the first.
export function total_seconds({ keyframes, closed }: CameraPath): number {
  const counted = closed && keyframes.length > 1 ? keyframes : keyframes.slice(0, -1);
  return counted.reduce((sum, k) => sum + k.seconds, 0);
}

// With numbers as exact as is of use, which makes a file and a message short.
export function rounded_path(path: CameraPath): CameraPath {
  const round = (x: number): number => Number(x.toPrecision(9));
  const vector = ([x, y, z]: Vec3): Vec3 => [round(x), round(y), round(z)];
  const keyframes = path.keyframes.map(({ position, rotation, fov_y, time, seconds }) => ({
    position: vector(position),
    rotation: [vector(rotation[0]), vector(rotation[1]), vector(rotation[2])] as Keyframe['rotation'],
    fov_y: round(fov_y),
    time: round(time),
    seconds: round(seconds),
  }));
  return { ...path, keyframes };
}

// The ranges of what a path holds are those of src/viz/cameras/camera_path.cpp.
const is_number = (x: unknown): x is number => typeof x === 'number' && Number.isFinite(x);
const is_in = (x: unknown, low: number, high: number): x is number => is_number(x) && x >= low && x <= high;
const is_side = (x: unknown): x is number => is_in(x, 1, 16384) && Number.isInteger(x);
const is_record = (x: unknown): x is Record<string, unknown> => typeof x === 'object' && x !== null;
const is_vector = (x: unknown): boolean => Array.isArray(x) && x.length === 3 && x.every(is_number);

function keyframe_problem(k: unknown): string {
  if (!is_record(k)) return 'is not an object';
  if (!is_vector(k['position'])) return 'needs a position of three numbers';
  const rotation = k['rotation'];
  if (!Array.isArray(rotation) || rotation.length !== 3 || !rotation.every(is_vector))
    return 'needs a rotation of 3×3 numbers';
  if (!is_in(k['fov_y'], 0.1, 179)) return 'needs a fov_y of 0.1 to 179 degrees';
  if (!is_in(k['time'], 0, 1)) return 'needs a time from 0 to 1';
  if (!is_in(k['seconds'], 0, 1e6)) return 'needs 0 to 1000000 seconds';
  return '';
}

// A path out of a file's text. Throws an Error whose message says what is wrong with it.
export function parse_path(text: string): CameraPath {
  let json: unknown;
  try {
    json = JSON.parse(text);
  } catch {
    throw new Error('This file is not JSON.');
  }
  if (!is_record(json) || json['format'] !== empty_path.format) throw new Error('This file is not a camera path.');
  if (json['version'] !== 1) throw new Error(`This camera path has version ${String(json['version'])}; 1 is known.`);
  const { width, height, fps, keyframes } = json;
  if (!is_side(width) || !is_side(height))
    throw new Error('The camera path needs a width and a height of 1 to 16384 whole pixels.');
  if (!is_in(fps, 0.1, 1000)) throw new Error('The camera path needs 0.1 to 1000 frames per second.');
  if (!Array.isArray(keyframes)) throw new Error('The camera path has no keyframes.');
  keyframes.forEach((k, i) => {
    const problem = keyframe_problem(k);
    if (problem) throw new Error(`Keyframe ${i + 1} of the camera path ${problem}.`);
  });
  return { ...empty_path, width, height, fps, closed: json['closed'] === true, keyframes: keyframes as Keyframe[] };
}
