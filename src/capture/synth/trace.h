#pragma once

#include <optional>

#include "capture/synth/sampler.h"
#include "capture/synth/scene.h"

// The light that a ray brings back from a stage: direct light of one disk with soft shadows, a constant
// ambient term, and mirror reflections of up to `max_bounces`.
namespace traceflow::synth {

inline constexpr int max_bounces = 6;

struct Hit {
  double distance;
  int body;
  Vector point;
  Vector normal;  // unit, turned towards where the ray came from
  Vec2<double> uv;
  Vector rest;  // the point of the body's matter, as point_in_world takes it
  int triangle;
};

// The nearest surface along the ray, if any.
std::optional<Hit> nearest_hit(const Stage& stage, const Ray& ray);

// Whether something stands between a point and a point of the stage's light. Planes hide nothing: they bound
// the room.
bool is_shadowed(const Stage& stage, const Vector& point, const Vector& light_point);

// Share of light that the material's coat reflects at this cosine of the angle to the normal.
Vector coat_reflectance(const Material& material, double cosine);

// What the ray sees: its picture is the sum. `diffuse` is the light that the first surface itself sends back,
// `specular` what comes by way of its coat. Both carry their weights.
struct Radiance {
  Vector diffuse{0};
  Vector specular{0};
};
Radiance trace_path(const Stage& stage, const Ray& first, Sampler& sampler);

}  // namespace traceflow::synth
