#include "capture/synth/scenes.h"

#include <cmath>

#include "capture/synth/room.h"

namespace traceflow::synth {

namespace {

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
  add({Sphere{0.25}, mirror({0.92, 0.93, 0.95}), mirror_ball_pose, 0, true});

  Material glaze = matt(patterned(Pattern::stripes, {0.10, 0.42, 0.44}, {0.62, 0.24, 0.16}, {8, 0}, 0.2));
  glaze.specular = Vector(0.32);
  glaze.roughness = 0.05;
  add({Sphere{0.16}, glaze, glossy_ball_pose, 1, true});
  add({Box{{0.07, 0.07, 0.09}},
       matt(patterned(Pattern::checker, {0.86, 0.52, 0.14}, {0.26, 0.22, 0.42}, {20, 20}, 0.15)),
       turning_box_pose, 2});

  add(standing_box(patterned(Pattern::checker, {0.76, 0.22, 0.18}, {0.84, 0.80, 0.70}, {16, 16}, 0.15),
                   {0.09, 0.08, 0.12}, {0.20, 0.42}, 0.6));
  add(standing_box(patterned(Pattern::stripes, {0.18, 0.54, 0.28}, {0.78, 0.80, 0.36}, {12, 12}, 0.15),
                   {0.08, 0.07, 0.16}, {-0.42, 0.40}, -0.3));
  add(resting_ball(patterned(Pattern::checker, {0.24, 0.40, 0.74}, {0.84, 0.84, 0.80}, {10, 5}, 0.1), 0.055,
                   {0.14, -0.36}, 0));
  add(standing_box(patterned(Pattern::stripes, {0.62, 0.24, 0.58}, {0.84, 0.78, 0.40}, {0, 24}, 0.15),
                   {0.05, 0.04, 0.04}, {-0.28, -0.38}, 0.7));
  add_far_clutter(scene);
  scene.arc = arc_of_balls();
  return scene;
}

constexpr double mirror_height = 0.42;

// The disk's normal is its body's +z. It faces -y, and nods and turns about its centre.
Mat3<double> mirror_rotation(double time) {
  const double phase = 2 * pi * time;
  return rotation_about(axis_z, 0.16 * std::sin(phase)) *
         rotation_about(axis_x, pi / 2 - 0.03 + 0.06 * std::sin(2 * phase));
}

Pose mirror_pose(double time) { return {{0, 0, mirror_height}, mirror_rotation(time)}; }

// The frame's disk lies just behind the mirror and appears as a rim around it.
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
  add({Disk{0.29}, mirror({0.93, 0.94, 0.95}), mirror_pose, 0, true});
  add({Disk{0.315}, matt(patterned(Pattern::checker, {0.66, 0.30, 0.16}, {0.80, 0.62, 0.28}, {14, 14}, 0.15)),
       frame_pose, 0});
  add(standing_box(patterned(Pattern::stripes, {0.30, 0.22, 0.18}, {0.56, 0.44, 0.34}, {20, 20}, 0.2),
                   {0.03, 0.02, 0.21}, {0, 0.085}, 0));
  add(standing_box(patterned(Pattern::checker, {0.34, 0.26, 0.20}, {0.62, 0.50, 0.38}, {20, 20}, 0.2),
                   {0.17, 0.11, 0.02}, {0, 0.06}, 0));
  add({Box{{0.06, 0.06, 0.10}},
       matt(patterned(Pattern::checker, {0.86, 0.50, 0.12}, {0.28, 0.22, 0.44}, {20, 20}, 0.15)),
       sliding_box_pose, 1});
  add({Box{{0.07, 0.07, 0.13}},
       matt(patterned(Pattern::stripes, {0.16, 0.48, 0.66}, {0.84, 0.80, 0.70}, {14, 14}, 0.15)),
       passing_box_pose, 2});

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

AnimatedScene make_scene(SynthScene scene) {
  switch (scene) {
    case SynthScene::balls:
      return balls();
    case SynthScene::mirror:
      return mirror_disk();
    case SynthScene::tumble:
      return tumble();
    case SynthScene::soft:
      return soft();
  }
  return balls();
}

}  // namespace traceflow::synth
