#include "capture/synth/scenes.h"

#include <cmath>
#include <numbers>

namespace traceflow::synth {

namespace {

constexpr double pi = std::numbers::pi;
constexpr double room_half_width = 1.7;
constexpr double room_height = 2.3;

const Vector axis_x(1, 0, 0);
const Vector axis_y(0, 1, 0);
const Vector axis_z(0, 0, 1);

Texture plain(const Vector& colour) { return {.first = colour}; }

Texture patterned(Pattern pattern, const Vector& first, const Vector& second, const Vec2<double>& frequency,
                  double grain = 0.35) {
  return {pattern, first, second, frequency, grain};
}

Material matt(const Texture& texture) { return {.albedo = texture}; }

Material mirror(const Vector& tint) { return {.albedo = plain(Vector(0)), .specular = tint}; }

Actor still(const Shape& shape, const Material& material, const Vector& position,
            const Mat3<double>& rotation = Mat3<double>(1)) {
  return {shape, material, [pose = Pose{position, rotation}](double) { return pose; }};
}

// A box that stands on the floor, turned about the vertical.
Actor standing_box(const Texture& texture, const Vector& half_size, const Vec2<double>& place, double angle) {
  return still(Box{half_size}, matt(texture), Vector(place, half_size.z), rotation_about(axis_z, angle));
}

Actor resting_ball(const Texture& texture, double radius, const Vec2<double>& place, double angle) {
  return still(Sphere{radius}, matt(texture), Vector(place, radius), rotation_about(axis_z, angle));
}

// Walls face inwards; each has a pattern of its own, so that a reflection tells where it looks.
void add_room(AnimatedScene& scene) {
  const double w = room_half_width;
  const auto wall = [&](const Texture& texture, const Vector& position, const Vector& axis, double angle) {
    scene.actors.push_back(still(Plane{}, matt(texture), position, rotation_about(axis, angle)));
  };
  wall(patterned(Pattern::checker, {0.74, 0.66, 0.52}, {0.46, 0.36, 0.27}, {5, 5}), {0, 0, 0}, axis_x, 0);
  wall(patterned(Pattern::checker, {0.80, 0.79, 0.76}, {0.70, 0.72, 0.76}, {2, 2}, 0.2), {0, 0, room_height},
       axis_x, pi);
  wall(patterned(Pattern::bricks, {0.62, 0.31, 0.22}, {0.78, 0.73, 0.66}, {4, 8}), {0, w, 0}, axis_x, pi / 2);
  wall(patterned(Pattern::checker, {0.32, 0.46, 0.64}, {0.72, 0.75, 0.72}, {3, 3}), {0, -w, 0}, axis_x,
       -pi / 2);
  wall(patterned(Pattern::stripes, {0.32, 0.52, 0.42}, {0.66, 0.72, 0.56}, {0, 4}), {-w, 0, 0}, axis_y,
       pi / 2);
  wall(patterned(Pattern::stripes, {0.70, 0.56, 0.26}, {0.56, 0.32, 0.38}, {3, 3}), {w, 0, 0}, axis_y,
       -pi / 2);
}

void add_light(AnimatedScene& scene) {
  Material material = matt(plain(Vector(0)));
  material.emission = Vector(5.6, 5.5, 5.3);
  scene.light = static_cast<int>(scene.actors.size());
  scene.actors.push_back(still(Disk{0.8}, material, {0, 0, room_height - 0.01}, rotation_about(axis_x, pi)));
  scene.ambient = 0.55;
}

// Furniture by the walls, out of the camera's way: most of it is seen by reflection only.
void add_far_clutter(AnimatedScene& scene) {
  const auto add = [&](const Actor& actor) { scene.actors.push_back(actor); };
  add(standing_box(patterned(Pattern::checker, {0.78, 0.20, 0.16}, {0.82, 0.74, 0.30}, {10, 10}),
                   {0.18, 0.12, 0.38}, {-0.42, -1.50}, 0.2));
  add(standing_box(patterned(Pattern::stripes, {0.16, 0.56, 0.60}, {0.80, 0.82, 0.80}, {8, 8}),
                   {0.15, 0.12, 0.52}, {0.40, -1.52}, -0.15));
  add(standing_box(patterned(Pattern::stripes, {0.56, 0.22, 0.56}, {0.82, 0.62, 0.30}, {0, 8}),
                   {0.14, 0.20, 0.42}, {1.42, -0.50}, 0.1));
  add(standing_box(patterned(Pattern::checker, {0.22, 0.50, 0.24}, {0.78, 0.78, 0.40}, {8, 8}),
                   {0.14, 0.22, 0.46}, {-1.42, -0.45}, -0.2));
  add(standing_box(patterned(Pattern::checker, {0.20, 0.28, 0.60}, {0.72, 0.74, 0.80}, {9, 9}),
                   {0.16, 0.13, 0.26}, {-0.62, 0.92}, 0.5));
  add(resting_ball(patterned(Pattern::checker, {0.82, 0.66, 0.16}, {0.70, 0.22, 0.16}, {12, 6}, 0.15), 0.15,
                   {0.64, 0.86}, 0.4));
}

CameraArc arc_around(const Vector& target, double distance, double elevation) {
  CameraArc arc;
  arc.target = target;
  arc.distance = distance;
  arc.half_angle = 0.5;
  arc.elevation = elevation;
  arc.elevation_swing = 0.07;
  arc.test_azimuth = 0.06;
  return arc;
}

Pose mirror_ball_pose(double time) {
  const double phase = 2 * pi * time;
  return {{-0.10 + 0.05 * std::sin(phase), 0.04 * std::cos(phase), 0.25}};
}

// Slides with the mirror ball and hops twice.
Pose glossy_ball_pose(double time) {
  const double phase = 2 * pi * time;
  const double height = 0.16 + 0.035 * (1 - std::cos(2 * phase));
  return {{0.35 + 0.05 * std::sin(phase), -0.10 + 0.05 * std::sin(2 * phase), height},
          rotation_about(axis_y, 0.7 * std::sin(phase))};
}

Pose turning_box_pose(double time) {
  const double phase = 2 * pi * time;
  return {{-0.50 + 0.03 * std::sin(phase), -0.08 + 0.14 * std::sin(phase), 0.09},
          rotation_about(axis_z, 0.4 + 0.5 * std::sin(phase))};
}

AnimatedScene balls() {
  AnimatedScene scene;
  add_room(scene);
  add_light(scene);
  const auto add = [&](const Actor& actor) { scene.actors.push_back(actor); };
  add({Sphere{0.25}, mirror({0.92, 0.93, 0.95}), mirror_ball_pose});

  Material glaze = matt(patterned(Pattern::stripes, {0.10, 0.42, 0.44}, {0.62, 0.24, 0.16}, {8, 0}, 0.2));
  glaze.specular = Vector(0.32);
  glaze.roughness = 0.05;
  add({Sphere{0.16}, glaze, glossy_ball_pose});
  add({Box{{0.07, 0.07, 0.09}},
       matt(patterned(Pattern::checker, {0.86, 0.52, 0.14}, {0.26, 0.22, 0.42}, {20, 20}, 0.15)),
       turning_box_pose});

  add(standing_box(patterned(Pattern::checker, {0.76, 0.22, 0.18}, {0.84, 0.80, 0.70}, {16, 16}, 0.15),
                   {0.09, 0.08, 0.12}, {0.20, 0.42}, 0.6));
  add(standing_box(patterned(Pattern::stripes, {0.18, 0.54, 0.28}, {0.78, 0.80, 0.36}, {12, 12}, 0.15),
                   {0.08, 0.07, 0.16}, {-0.42, 0.40}, -0.3));
  add(resting_ball(patterned(Pattern::checker, {0.24, 0.40, 0.74}, {0.84, 0.84, 0.80}, {10, 5}, 0.1), 0.055,
                   {0.14, -0.36}, 0));
  add(standing_box(patterned(Pattern::stripes, {0.62, 0.24, 0.58}, {0.84, 0.78, 0.40}, {0, 24}, 0.15),
                   {0.05, 0.04, 0.04}, {-0.28, -0.38}, 0.7));
  add_far_clutter(scene);
  scene.arc = arc_around({0, 0, 0.22}, 1.28, 0.28);
  return scene;
}

constexpr double mirror_height = 0.42;

// The disk's normal is its body's +z: it faces -y and nods and turns about its centre.
Mat3<double> mirror_rotation(double time) {
  const double phase = 2 * pi * time;
  return rotation_about(axis_z, 0.16 * std::sin(phase)) *
         rotation_about(axis_x, pi / 2 - 0.03 + 0.06 * std::sin(2 * phase));
}

Pose mirror_pose(double time) { return {{0, 0, mirror_height}, mirror_rotation(time)}; }

// The frame's disk lies just behind the mirror and shows as a rim around it.
Pose frame_pose(double time) {
  const Mat3<double> rotation = mirror_rotation(time);
  return {Vector(0, 0, mirror_height) - 0.006 * rotation[2], rotation};
}

Pose sliding_box_pose(double time) {
  const double phase = 2 * pi * time;
  return {{0.14 * std::sin(phase), -0.42 + 0.05 * std::cos(phase), 0.10},
          rotation_about(axis_z, 0.6 * phase)};
}

Pose passing_box_pose(double time) {
  const double phase = 2 * pi * time;
  return {{0.46 + 0.04 * std::cos(phase), -0.05 + 0.20 * std::sin(phase), 0.13},
          rotation_about(axis_z, 0.5 - 0.7 * std::sin(phase))};
}

AnimatedScene mirror_disk() {
  AnimatedScene scene;
  add_room(scene);
  add_light(scene);
  const auto add = [&](const Actor& actor) { scene.actors.push_back(actor); };
  add({Disk{0.29}, mirror({0.93, 0.94, 0.95}), mirror_pose});
  add({Disk{0.315}, matt(patterned(Pattern::checker, {0.66, 0.30, 0.16}, {0.80, 0.62, 0.28}, {14, 14}, 0.15)),
       frame_pose});
  add(standing_box(patterned(Pattern::stripes, {0.30, 0.22, 0.18}, {0.56, 0.44, 0.34}, {20, 20}, 0.2),
                   {0.03, 0.02, 0.21}, {0, 0.085}, 0));
  add(standing_box(patterned(Pattern::checker, {0.34, 0.26, 0.20}, {0.62, 0.50, 0.38}, {20, 20}, 0.2),
                   {0.17, 0.11, 0.02}, {0, 0.06}, 0));
  add({Box{{0.06, 0.06, 0.10}},
       matt(patterned(Pattern::checker, {0.86, 0.50, 0.12}, {0.28, 0.22, 0.44}, {20, 20}, 0.15)),
       sliding_box_pose});
  add({Box{{0.07, 0.07, 0.13}},
       matt(patterned(Pattern::stripes, {0.16, 0.48, 0.66}, {0.84, 0.80, 0.70}, {14, 14}, 0.15)),
       passing_box_pose});

  add(standing_box(patterned(Pattern::checker, {0.76, 0.22, 0.18}, {0.84, 0.80, 0.70}, {16, 16}, 0.15),
                   {0.09, 0.08, 0.16}, {-0.44, 0.02}, 0.5));
  add(resting_ball(patterned(Pattern::checker, {0.22, 0.56, 0.30}, {0.84, 0.82, 0.50}, {10, 5}, 0.1), 0.09,
                   {-0.39, -0.46}, 0.3));
  add(standing_box(patterned(Pattern::stripes, {0.62, 0.24, 0.58}, {0.84, 0.78, 0.40}, {0, 14}, 0.15),
                   {0.07, 0.07, 0.14}, {0.40, -0.62}, 0.4));
  add_far_clutter(scene);
  scene.arc = arc_around({0, 0, 0.38}, 1.32, 0.20);
  return scene;
}

}  // namespace

AnimatedScene make_scene(SynthScene scene) { return scene == SynthScene::mirror ? mirror_disk() : balls(); }

}  // namespace traceflow::synth
