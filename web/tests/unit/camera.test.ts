import assert from 'node:assert/strict';
import { test } from 'node:test';
import {
  degrees,
  down_of,
  forward_of,
  look_at,
  project,
  project_line,
  ray_through,
  right_of,
  widened,
} from '../../src/math/camera.ts';
import { about, multiply, orthonormal, slerp, to_matrix, to_quaternion, transpose } from '../../src/math/rotation.ts';
import { add_scaled, cross, dot, scale, unit } from '../../src/math/vec.ts';
import { near, near_vector, numbers, vector } from './near.ts';

const up: [number, number, number] = [0, 0, 1];
const camera = look_at([1, -3, 2], [0.2, 0.1, 0.3], up, 40);

test('the axes are x right, y down, z forward', () => {
  near_vector(cross(right_of(camera), down_of(camera)), forward_of(camera));
  near(dot(right_of(camera), up), 0);
  assert.ok(dot(down_of(camera), up) < 0);
});

test('the target is in the middle, and what is above it above', () => {
  const middle = project(camera, 1.6, [0.2, 0.1, 0.3]);
  near(middle?.x ?? NaN, 0.5);
  near(middle?.y ?? NaN, 0.5);
  assert.ok((project(camera, 1.6, [0.2, 0.1, 0.5])?.y ?? 1) < 0.5);
  assert.ok((project(camera, 1.6, add_scaled([0.2, 0.1, 0.3], right_of(camera), 0.1))?.x ?? 0) > 0.5);
});

test('a ray through a point meets what is projected there', () => {
  const next = numbers(1);
  for (let i = 0; i < 50; i++) {
    const point = { x: next() / 2 + 0.5, y: next() / 2 + 0.5 };
    const there = add_scaled(camera.position, ray_through(camera, 1.3, point), 0.5 + Math.abs(next()));
    const seen = project(camera, 1.3, there);
    near_vector([seen?.x ?? NaN, seen?.y ?? NaN], [point.x, point.y]);
  }
});

test('the vertical angle is that of the picture', () => {
  const top = ray_through(camera, 2, { x: 0.5, y: 0 });
  near(degrees(Math.acos(dot(top, forward_of(camera)))), 20, 1e-6);
});

test('what is behind the camera is not in the picture', () => {
  assert.equal(project(camera, 1, add_scaled(camera.position, forward_of(camera), -1)), null);
});

test('a line through the plane of the camera is cut at the near depth', () => {
  const ahead = add_scaled(camera.position, forward_of(camera), 2);
  const behind = add_scaled(camera.position, forward_of(camera), -2);
  const ends = project_line(camera, 1, ahead, add_scaled(behind, right_of(camera), 1), 0.01);
  assert.ok(ends && ends.flatMap((p) => [p.x, p.y]).every(Number.isFinite));
  near(ends[0].x, 0.5);
  const turned = project_line(camera, 1, add_scaled(behind, right_of(camera), 1), ahead, 0.01);
  near_vector([turned?.[0].x ?? NaN, turned?.[1].x ?? NaN], [ends[1].x, ends[0].x]);
  assert.equal(project_line(camera, 1, behind, behind, 0.01), null);
  const whole = project_line(camera, 1, ahead, add_scaled(ahead, right_of(camera), 0.2), 0.01);
  near(whole?.[1].x ?? NaN, project(camera, 1, add_scaled(ahead, right_of(camera), 0.2))?.x ?? NaN);
});

test('a narrow picture is as wide as a square one', () => {
  assert.equal(widened(camera, 1.5), camera);
  const narrow = widened(camera, 0.5);
  const left = ray_through(narrow, 0.5, { x: 0, y: 0.5 });
  near_vector(left, ray_through(camera, 1, { x: 0, y: 0.5 }));
});

test('matrices and quaternions say the same', () => {
  const next = numbers(7);
  for (let i = 0; i < 40; i++) {
    const m = about(unit(vector(next)), next() * Math.PI);
    to_matrix(to_quaternion(m)).forEach((row, j) => near_vector(row, m[j] ?? []));
    orthonormal(m).forEach((row, j) => near_vector(row, m[j] ?? []));
    multiply(m, transpose(m)).forEach((row, j) =>
      near_vector(
        row,
        [0, 1, 2].map((k) => Number(k === j)),
      ),
    );
  }
});

test('half of the way between two rotations is half of the angle', () => {
  const axis = unit([1, 2, -1]);
  const from = about(axis, 0.3);
  slerp(from, about(axis, 1.7), 0.5).forEach((row, i) => near_vector(row, about(axis, 1)[i] ?? []));
  slerp(from, about(axis, 0.3 + 1.6 * Math.PI), 0.5).forEach((row, i) =>
    near_vector(row, about(axis, 0.3 - 0.2 * Math.PI)[i] ?? []),
  );
  slerp(from, from, 0.4).forEach((row, i) => near_vector(row, from[i] ?? []));
});

test('right-handed about an axis', () => {
  const turned = about([0, 0, 1], Math.PI / 2);
  near_vector(
    turned.map((row) => row[0]),
    [0, 1, 0],
  );
  near_vector(scale([1, 2, 3], 2), [2, 4, 6]);
});
