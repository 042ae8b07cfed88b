#pragma once

#include <optional>

#include "capture/synth/sampler.h"
#include "capture/synth/scene.h"

// The light along a ray in a stage: direct light of one disk with soft shadows, a constant ambient term, and
// up to `max_bounces` mirror reflections.
namespace traceflow::synth {

inline constexpr int max_bounces = 6;

struct Hit {
  double distance;
  int body;
  Vector point;
  Vector normal;  // unit, turned towards the ray's origin
  Vec2<double> uv;
  Vector rest;  // the material point, as for point_in_world
  int triangle;
};

// The nearest hit along the ray, if any.
std::optional<Hit> nearest_hit(const Stage& stage, const Ray& ray);

// Whether a body blocks the path between a point and a point of the stage's light. Planes block nothing: they
// are the walls.
bool is_shadowed(const Stage& stage, const Vector& point, const Vector& light_point);

// The fraction of light that the material's coat reflects at this cosine of the angle to the normal.
Vector coat_reflectance(const Material& material, double cosine);

// What the ray sees; its colour is the sum. `diffuse` is the light from the first surface itself, `specular`
// the light that its coat reflects. Both are weighted.
struct Radiance {
  Vector diffuse{0};
  Vector specular{0};
};
Radiance trace_path(const Stage& stage, const Ray& first, Sampler& sampler);

}  // namespace traceflow::synth
