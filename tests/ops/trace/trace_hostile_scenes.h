#pragma once

#include <limits>

#include "ops/trace/trace_scene.h"

// What a tracer may break at. Surfels are broken from index `first` on, each in its own way; the index behind
// the last one comes back.
namespace traceflow::trace {

inline constexpr float nan = std::numeric_limits<float>::quiet_NaN();
inline constexpr float infinite = std::numeric_limits<float>::infinity();
inline constexpr float largest = std::numeric_limits<float>::max();
inline constexpr float smallest = std::numeric_limits<float>::denorm_min();

inline int64_t make_not_finite(PosedSurfels& s, int64_t first = 0) {
  for (const float value : {nan, infinite, -infinite}) {
    s.position(first++, 1) = value;
    s.scale(first++, 0) = value;
    s.rotation(first++, 3) = value;
    s.opacity[first++] = value;
    s.sh.row(first++)[7] = value;
  }
  return first;
}

inline int64_t take_area_or_opacity(PosedSurfels& s, int64_t first = 0) {
  s.scale(first++, 0) = 0;
  s.scale(first++, 1) = -1;
  s.scale(first++, 0) = -0.0F;
  s.opacity[first++] = 0;
  s.opacity[first++] = -1;
  s.opacity[first++] = 0.5F / 255;
  return first;
}

inline int64_t move_beyond_measure(PosedSurfels& s, int64_t first = 0) {
  s.position(first++, 0) = largest;
  s.position(first++, 2) = -1e20F;
  s.scale(first++, 0) = largest;
  return first;
}

// Surfels that can be hit all the same.
inline void make_extreme(PosedSurfels& s) {
  s.position(0, 0) = 1e14F;
  s.scale(1, 0) = 1e14F;
  s.scale(2, 0) = smallest;
  s.scale(3, 0) = s.scale(3, 1) = 1e-30F;
  for (int k = 0; k < 4; ++k) s.rotation(4, k) = 0;
  for (int k = 0; k < 4; ++k) s.rotation(5, k) = 1e-30F;
  for (int k = 0; k < 4; ++k) s.rotation(6, k) = 1e30F;
  s.opacity[7] = 5;
}

// The first rays cannot be traced. Returns how many.
inline int64_t break_rays(TestScene& scene) {
  int64_t broken = 0;
  for (const float value : {nan, infinite, -infinite}) {
    scene.rays.origins(broken++, 0) = value;
    scene.rays.directions(broken++, 2) = value;
  }
  for (int k = 0; k < 3; ++k) scene.rays.directions(broken, k) = 0;
  return broken + 1;
}

// Likewise the first cones.
inline int64_t break_widths(TestScene& scene) {
  scene.rays.widths = Tensor<float>({scene.rays.count()});
  int64_t broken = 0;
  for (const float value : {nan, infinite, -infinite, -0.1F}) scene.rays.widths[broken++] = value;
  return broken;
}

inline void make_rays_extreme(TestScene& scene) {
  for (int k = 0; k < 3; ++k) {
    scene.rays.origins(0, k) = largest;
    scene.rays.origins(1, k) = 1e20F;
    scene.rays.directions(2, k) = smallest;
    scene.rays.directions(3, k) = 1e-30F;
    scene.rays.directions(4, k) = 1e30F;
    scene.rays.directions(5, k) = largest;
  }
  scene.rays.directions(6, 0) = scene.rays.directions(6, 1) = -0.0F;
  scene.rays.directions(7, 1) = scene.rays.directions(7, 2) = 0;
}

inline TestScene rays_inside_a_plane() {
  TestScene scene = blank_scene(1, 0, 2);
  set_facing(scene.surfels, 0, 1, 1, 0.5F);
  scene.rays.directions(0, 0) = 1;  // parallel to the plane
  scene.rays.origins(1, 0) = -5;    // in the plane
  scene.rays.origins(1, 2) = 1;
  scene.rays.directions(1, 0) = 1;
  return scene;
}

// One ray through surfels that face it, one unit behind the other.
inline TestScene surfels_in_a_row(int64_t count) {
  TestScene scene = blank_scene(count, 0, 1);
  for (int64_t i = 0; i < count; ++i) set_facing(scene.surfels, i, 2 + static_cast<float>(i), 0.5F, 0.8F);
  scene.rays.directions(0, 2) = 1;
  return scene;
}

// Nothing tells them apart but their index.
inline TestScene surfels_in_one_place(int64_t count) {
  TestScene scene = blank_scene(count, 0, 1);
  for (int64_t i = 0; i < count; ++i) set_facing(scene.surfels, i, 1, 1, 0.01F);
  scene.rays.directions(0, 2) = 1;
  return scene;
}

// Each half as far as the one before. To be traced from 0 on.
inline TestScene surfels_of_every_scale(int64_t count) {
  TestScene scene = blank_scene(count, 0, 1);
  for (int64_t i = 0; i < count; ++i) {
    const float depth = std::ldexp(1.0F, static_cast<int>(i % 100) - 90);
    set_facing(scene.surfels, i, depth, depth * 0.1F, 0.01F);
  }
  scene.rays.directions(0, 2) = 1;
  return scene;
}

}  // namespace traceflow::trace
