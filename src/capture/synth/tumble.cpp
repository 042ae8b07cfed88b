#include <cmath>

#include "capture/synth/room.h"
#include "capture/synth/scenes.h"

namespace traceflow::synth {

namespace {

// Motion of an object carried by hand. It moves from `start` by `travel`, slightly off the straight line,
// turns about a tilted axis and rocks about another. At time 0 it is not rotated.
struct Carry {
  Vector start;
  Vector travel;
  Vector sway;
  Vector axis;
  double turn;  // radians, like rock
  Vector rock_axis;
  double rock;

  Pose at(double time) const {
    const double phase = 2 * pi * time;
    // Slow at both ends; the speed is never zero and never changes suddenly.
    const double way = time - (0.55 * std::sin(phase) + 0.14 * std::sin(2 * phase)) / (2 * pi);
    const double turned = 0.5 - 0.5 * std::cos(pi * time);
    const Vector shaken = sway * std::sin(pi * time) + Vector(0, 0, 0.008) * std::sin(2.5 * phase);
    return {start + way * travel + shaken,
            rotation_about(normalize(axis), turn * turned) *
                rotation_about(normalize(rock_axis), rock * std::sin(1.5 * phase))};
  }
};

const Carry kettle_carry{.start = {-0.25, 0.17, 0.19},
                         .travel = {0.05, -0.39, 0.17},
                         .sway = {-0.03, 0, 0.02},
                         .axis = {0.35, -0.25, 1},
                         .turn = 1.6,
                         .rock_axis = {1, 0.4, 0},
                         .rock = 0.12};

const Carry crate_carry{.start = {0.25, -0.15, 0.19},
                        .travel = {0.21, 0.34, 0.13},
                        .sway = {0.03, 0, 0.03},
                        .axis = {-0.6, 0.3, 1},
                        .turn = 1.5,
                        .rock_axis = {0, 1, 0.3},
                        .rock = 0.10};

// A part of a rigid object; `place` is its pose in the object.
Actor part(const Shape& shape, const Material& material, const Carry& whole, const Pose& place, int object) {
  const auto pose_at = [whole, place](double time) -> Pose {
    const Pose carried = whole.at(time);
    return {carried.world_from_body * place.position + carried.position,
            carried.world_from_body * place.world_from_body};
  };
  return {shape, material, pose_at, object, true};
}

// A mirror ball. Its spout, handle, knob and foot break the symmetry.
void add_kettle(AnimatedScene& scene, int object) {
  const auto add = [&](const Shape& shape, const Material& material, const Vector& position,
                       const Mat3<double>& rotation = Mat3<double>(1)) {
    scene.actors.push_back(part(shape, material, kettle_carry, {position, rotation}, object));
  };
  add(Sphere{0.14}, mirror({0.92, 0.93, 0.95}), {0, 0, 0});
  add(Box{{0.075, 0.022, 0.028}}, mirror({0.94, 0.62, 0.42}), {0.185, 0, 0.045},
      rotation_about(axis_y, -0.6));

  const Material grip =
      matt(patterned(Pattern::stripes, {0.88, 0.72, 0.14}, {0.12, 0.13, 0.30}, {0, 34}, 0.15));
  add(Box{{0.045, 0.016, 0.014}}, grip, {-0.165, 0, 0.075});
  add(Box{{0.045, 0.016, 0.014}}, grip, {-0.165, 0, -0.065});
  add(Box{{0.014, 0.018, 0.095}}, grip, {-0.215, 0, 0.005});

  Material glaze = matt(plain({0.74, 0.10, 0.12}));
  glaze.specular = Vector(0.06);
  add(Sphere{0.04}, glaze, {0, 0, 0.165});
  add(Box{{0.085, 0.085, 0.012}},
      matt(patterned(Pattern::checker, {0.14, 0.46, 0.30}, {0.84, 0.82, 0.74}, {22, 22}, 0.15)),
      {0, 0, -0.132});
}

}  // namespace

AnimatedScene tumble() {
  AnimatedScene scene;
  add_room(scene);
  add_light(scene);
  const auto add = [&](const Actor& actor) { scene.actors.push_back(actor); };
  add_kettle(scene, 0);
  Texture patches = patterned(Pattern::patches, Vector(0.08), {0.97, 0.96, 0.93}, Vec2<double>(22), 0.35);
  patches.grain_frequency = 70;
  add(part(Box{{0.12, 0.10, 0.13}}, matt(patches), crate_carry, {}, 1));

  add(standing_box(patterned(Pattern::checker, {0.76, 0.22, 0.18}, {0.84, 0.80, 0.70}, {16, 16}, 0.15),
                   {0.09, 0.08, 0.12}, {0.02, 0.55}, 0.6));
  add(standing_box(patterned(Pattern::stripes, {0.18, 0.54, 0.28}, {0.78, 0.80, 0.36}, {12, 12}, 0.15),
                   {0.08, 0.07, 0.16}, {-0.62, 0.30}, -0.3));
  add(resting_ball(patterned(Pattern::checker, {0.24, 0.40, 0.74}, {0.84, 0.84, 0.80}, {10, 5}, 0.1), 0.055,
                   {0.02, -0.30}, 0));
  add(standing_box(patterned(Pattern::stripes, {0.62, 0.24, 0.58}, {0.84, 0.78, 0.40}, {0, 24}, 0.15),
                   {0.05, 0.04, 0.04}, {-0.34, -0.30}, 0.7));
  add_far_clutter(scene);
  scene.arc = arc_of_balls();
  return scene;
}

}  // namespace traceflow::synth
