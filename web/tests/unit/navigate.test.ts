import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { Vec3 } from '../../src/messages.ts';
import { degrees, forward_of, look_at, project, right_of } from '../../src/math/camera.ts';
import { between, eased, flight_time } from '../../src/math/flight.ts';
import { centred, fly, look_around, orbit, pan, zoom, type Viewpoint } from '../../src/math/navigate.ts';
import { about, multiply } from '../../src/math/rotation.ts';
import { distance, dot, subtract } from '../../src/math/vec.ts';
import { near, near_vector, numbers } from './near.ts';

const up: Vec3 = [0, 0, 1];
const start: Viewpoint = { camera: look_at([0, -3, 1], [0, 0, 0.2], up, 35), pivot: [0.3, 0.1, 0.4] };
const level = (view: Viewpoint): number => dot(right_of(view.camera), up);

test('an orbit keeps the pivot at its distance and at its place in the picture', () => {
  const next = numbers(3);
  const before = project(start.camera, 1.5, start.pivot);
  let view = start;
  for (let i = 0; i < 200; i++) view = orbit(view, up, next() * 0.4, next() * 0.3);
  near(distance(view.camera.position, view.pivot), distance(start.camera.position, start.pivot), 1e-9);
  const after = project(view.camera, 1.5, view.pivot);
  near_vector([after?.x ?? NaN, after?.y ?? NaN], [before?.x ?? NaN, before?.y ?? NaN], 1e-9);
  near(level(view), 0, 1e-9);
});

test('an orbit to the right takes the camera to the left', () => {
  const view = orbit(start, up, 0.2, 0);
  assert.ok(dot(subtract(view.camera.position, start.camera.position), right_of(start.camera)) < 0);
  assert.ok(orbit(start, up, 0, 0.2).camera.position[2] > start.camera.position[2]);
});

test('the view never turns over', () => {
  let view = start;
  for (let i = 0; i < 100; i++) view = orbit(view, up, 0, 0.2);
  assert.ok(degrees(Math.acos(dot(forward_of(view.camera), up))) < 178.001);
  for (let i = 0; i < 200; i++) view = look_around(view, up, 0, -0.2);
  assert.ok(degrees(Math.acos(dot(forward_of(view.camera), up))) > 1.999);
});

test('a tilted camera stays as tilted', () => {
  const tilt = multiply(about(forward_of(start.camera), 0.3), start.camera.rotation);
  const tilted = { ...start, camera: { ...start.camera, rotation: tilt } };
  const roll = (view: Viewpoint): number =>
    Math.asin(dot(right_of(view.camera), up) / Math.hypot(forward_of(view.camera)[0], forward_of(view.camera)[1]));
  near(roll(orbit(tilted, up, 0.7, 0.25)), roll(tilted), 1e-9);
});

test('looking around leaves the camera where it is and the pivot ahead', () => {
  const view = look_around(start, up, 0.3, -0.1);
  near_vector(view.camera.position, start.camera.position);
  const seen = project(view.camera, 1, view.pivot);
  near_vector([seen?.x ?? NaN, seen?.y ?? NaN], [0.5, 0.5]);
  assert.ok(dot(forward_of(view.camera), right_of(start.camera)) > 0);
  assert.ok(forward_of(view.camera)[2] > forward_of(start.camera)[2]);
});

test('a pan takes what was at the pivot along with the hand', () => {
  const before = project(start.camera, 1, start.pivot);
  const after = project(pan(start, 0.1, -0.2).camera, 1, start.pivot);
  near((after?.x ?? NaN) - (before?.x ?? NaN), 0.1);
  near((after?.y ?? NaN) - (before?.y ?? NaN), -0.2);
});

test('a zoom comes nearer to the pivot, within bounds', () => {
  const far = distance(start.camera.position, start.pivot);
  near(distance(zoom(start, 0.5, 0.01, 100).camera.position, start.pivot), far / 2);
  near(distance(zoom(start, 1e-9, 0.01, 100).camera.position, start.pivot), 0.01);
  near(distance(zoom(start, 1e9, 0.01, 100).camera.position, start.pivot), 100);
});

test('flying goes along the view and up', () => {
  const view = fly(start, up, 0, 0.5, 1);
  near(dot(subtract(view.camera.position, start.camera.position), right_of(start.camera)), 0);
  near_vector(subtract(view.pivot, start.pivot), subtract(view.camera.position, start.camera.position));
});

test('centring turns towards the pivot without moving', () => {
  const view = centred(start, up);
  near_vector(view.camera.position, start.camera.position);
  const seen = project(view.camera, 1, start.pivot);
  near_vector([seen?.x ?? NaN, seen?.y ?? NaN], [0.5, 0.5]);
});

test('a flight begins and ends where it should and goes around the centre', () => {
  const centre: Vec3 = [0, 0, 0.2];
  const to = look_at([0, 4, 0.8], centre, up, 50);
  for (const [t, expected] of [
    [0, start.camera],
    [1, to],
  ] as const) {
    const found = between(start.camera, to, centre, t);
    near_vector(found.position, expected.position, 1e-6);
    found.rotation.forEach((row, i) => near_vector(row, expected.rotation[i] ?? [], 1e-6));
    near(found.fov_y, expected.fov_y);
  }
  for (let t = 0; t <= 1; t += 0.05) {
    const found = between(start.camera, to, centre, t);
    assert.ok(distance(found.position, centre) > 2.9, `${distance(found.position, centre)} at ${t}`);
  }
  // Opposite sides: there is no one way around, but there is one.
  const opposite = look_at([0, 3, -0.6], centre, up, 35);
  assert.ok(between(start.camera, opposite, centre, 0.5).position.every(Number.isFinite));
  assert.ok(distance(between(start.camera, opposite, centre, 0.5).position, centre) > 2);
});

test('flights are eased and of a bearable length', () => {
  near_vector([eased(0), eased(0.5), eased(1)], [0, 0.5, 1]);
  near(flight_time(start.camera, start.camera, 1), 350);
  near(flight_time(start.camera, look_at([99, 0, 0], [0, 0, 0], up, 35), 1), 900);
});
