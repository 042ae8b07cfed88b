#pragma once

#include "ops/trace/trace_kernels.h"

// The key by which rays are sorted for tracing.
namespace traceflow::trace {

inline constexpr int ray_key_bits = 31;
inline constexpr uint32_t untraceable_key = 1U << 30;  // greater than all 30-bit keys

// Moves the lower 10 bits to bits 0, 3, 6, …
TRACEFLOW_HD inline uint32_t spread_bits(uint32_t x) {
  x = (x | x << 16) & 0x030000FFU;
  x = (x | x << 8) & 0x0300F00FU;
  x = (x | x << 4) & 0x030C30C3U;
  return (x | x << 2) & 0x09249249U;
}

TRACEFLOW_HD inline uint32_t morton_key(const Vec3<float>& unit_cube) {
  const Vec3<float> cell = glm::clamp(unit_cube, Vec3<float>(0), Vec3<float>(1)) * 1023.0F;
  return spread_bits(static_cast<uint32_t>(cell.x)) | spread_bits(static_cast<uint32_t>(cell.y)) << 1 |
         spread_bits(static_cast<uint32_t>(cell.z)) << 2;
}

// The key along a space-filling curve of the ray's point at the distance `sample_distance`, relative to
// `centre`.
TRACEFLOW_HD inline uint32_t ray_key(const RayView& rays, int64_t i, const Vec3<float>& centre,
                                     float sample_distance) {
  UnitRay ray;
  if (!make_unit_ray(rays, i, ray)) return untraceable_key;
  const float scale = 0.25F / sample_distance;
  return morton_key(scale * (ray.origin + sample_distance * ray.direction - centre) + Vec3<float>(0.5F));
}

}  // namespace traceflow::trace
