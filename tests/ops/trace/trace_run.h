#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>

#include "ops/trace/trace.h"
#include "ops/trace/trace_scene.h"

namespace traceflow::trace {

// Both passes of the fast path.
struct Traced {
  Output output;
  InputGradient gradient;
  int64_t hits = 0;
};

inline Traced trace(const TestScene& scene, const Options& options, uint64_t gradient_seed = 5) {
  const BvhPtr bvh = make_bvh();
  const SavedPtr saved = make_saved();
  Traced result;
  build(scene.surfels, options, *bvh);
  forward(scene.surfels, *bvh, scene.rays, options, result.output, saved.get());
  backward(scene.surfels, scene.rays, options, *saved,
           to_float(random_output_gradient(gradient_seed, scene.rays.count())), result.gradient);
  result.hits = blended_hits(*saved);
  return result;
}

inline bool same_bytes(const Tensor<float>& a, const Tensor<float>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.values().size_bytes()) == 0);
}

inline bool same_bytes(const Output& a, const Output& b) {
  return same_bytes(a.colour, b.colour) && same_bytes(a.alpha, b.alpha) && same_bytes(a.distance, b.distance);
}

inline bool same_bytes(const InputGradient& a, const InputGradient& b) {
  return same_bytes(a.surfels.position, b.surfels.position) && same_bytes(a.surfels.scale, b.surfels.scale) &&
         same_bytes(a.surfels.rotation, b.surfels.rotation) &&
         same_bytes(a.surfels.opacity, b.surfels.opacity) && same_bytes(a.surfels.sh, b.surfels.sh) &&
         same_bytes(a.rays.origins, b.rays.origins) && same_bytes(a.rays.directions, b.rays.directions) &&
         same_bytes(a.rays.widths, b.rays.widths) && same_bytes(a.position_gradient, b.position_gradient);
}

inline bool all_finite(const Tensor<float>& t) {
  return std::all_of(t.values().begin(), t.values().end(), [](float v) { return std::isfinite(v); });
}

inline bool all_finite(const Traced& t) {
  const auto& g = t.gradient;
  return all_finite(t.output.colour) && all_finite(t.output.alpha) && all_finite(t.output.distance) &&
         all_finite(g.surfels.position) && all_finite(g.surfels.scale) && all_finite(g.surfels.rotation) &&
         all_finite(g.surfels.opacity) && all_finite(g.surfels.sh) && all_finite(g.rays.origins) &&
         all_finite(g.rays.directions) && all_finite(g.rays.widths) && all_finite(g.position_gradient);
}

}  // namespace traceflow::trace
