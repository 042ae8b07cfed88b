#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "math/spherical_harmonics.h"
#include "math/types.h"
#include "ops/trace/trace.h"
#include "ops/trace/trace_hits.h"
#include "ops/trace/trace_order.h"
#include "ops/trace/trace_usable.h"

// Shared definitions of the tracer's forward and backward passes.
namespace traceflow::trace {

inline constexpr int64_t rays_per_block = 256;

// The blended hits of a block of rays: ray after ray in the tracer's order, front to back in each ray.
struct SavedBlock {
  std::vector<uint32_t> surfel;
  std::vector<float> distance;  // scene units
  std::vector<float> alpha;
  std::vector<uint32_t> ray_end;  // the end of each ray's hits

  // `names`: as in HitSorter.
  void append(const Hits& hits, size_t count, const uint32_t* names) {
    const size_t before = surfel.size();
    surfel.insert(surfel.end(), hits.surfel, hits.surfel + count);
    for (size_t i = before; names && i < surfel.size(); ++i) surfel[i] = names[surfel[i]];
    distance.insert(distance.end(), hits.distance, hits.distance + count);
    alpha.insert(alpha.end(), hits.alpha, hits.alpha + count);
  }
  void end_ray() { ray_end.push_back(static_cast<uint32_t>(surfel.size())); }
  void clear() {
    surfel.clear();
    distance.clear();
    alpha.clear();
    ray_end.clear();
  }
};

namespace cuda {
struct SavedHits;
}  // namespace cuda

struct Saved {
  Device device = Device::cpu;  // of the forward pass
  RayOrder order;
  std::vector<SavedBlock> blocks;
  std::shared_ptr<cuda::SavedHits> on_device;
  int64_t device_bytes = int64_t{1} << 30;  // limit for the lists on the device
};

// One block of rays of a forward pass.
struct BlockTask {
  const PosedSurfels& surfels;
  const Bvh& bvh;
  const Rays& rays;
  const Options& options;
  const RayOrder& order;
  int64_t begin, end;  // range in that order
  Output& output;
  SavedBlock* saved;  // may be null
};

// A ray with a unit direction, so that t is a distance.
struct UnitRay {
  Vec3<float> origin{0};
  Vec3<float> direction{0};
  float length = 0;  // of the caller's direction
  float width = 0;   // of its cone, at distance 1
};

// The number of standard deviations at which a Gaussian of opacity 1 falls to alpha_min, with a margin for
// rounding. A cone can hit a surfel only if its axis passes within this multiple of the surfel's standard
// deviation plus the cone's.
inline float cone_deviations(const Options& o) {
  return 1.001F * std::sqrt(std::fmax(0.0F, -2 * std::log(o.alpha_min)));
}

// Addresses of rays, on either device. widths: null if all are 0.
struct RayView {
  const float *origins = nullptr, *directions = nullptr, *widths = nullptr;

  RayView() = default;
  explicit RayView(const Rays& rays)
      : origins(rays.origins.data()),
        directions(rays.directions.data()),
        widths(rays.widths.empty() ? nullptr : rays.widths.data()) {}
};

// Returns false for a ray that gets only the background. Scales first, so that no square overflows or
// underflows.
TRACEFLOW_HD inline bool make_unit_ray(const RayView& rays, int64_t i, UnitRay& ray) {
  const float *origin = rays.origins + 3 * i, *direction = rays.directions + 3 * i;
  const float width = rays.widths != nullptr ? rays.widths[i] : 0;
  if (!is_traceable(origin, direction) || !is_width(width)) return false;
  const Vec3<float> d = load3<float>(direction);
  const float largest = std::fmax(std::abs(d.x), std::fmax(std::abs(d.y), std::abs(d.z)));
  const Vec3<float> scaled = d / largest;
  const float scaled_length = std::sqrt(dot(scaled, scaled));
  ray = {load3<float>(origin), scaled / scaled_length, largest * scaled_length, width};
  return std::isfinite(ray.length);
}

// The SH basis of a direction, padded with zeros so that a vector can be loaded from any coefficient on.
inline constexpr int padded_basis = 32;
inline void padded_sh_basis(int degree, const Vec3<float>& direction, float* basis) {
  std::fill_n(basis, padded_basis, 0.0F);
  sh_basis(degree, direction, basis);
}

}  // namespace traceflow::trace
