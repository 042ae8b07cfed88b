#pragma once

#include <cstdint>
#include <vector>

#include "ops/trace/trace_bvh.h"

namespace traceflow::trace {

// An order of rays in which neighbours have similar paths, whatever the caller's order.
struct RayOrder {
  std::vector<uint32_t> ray;  // untraceable rays are last
  float sample_distance = 0;  // typical distance from the rays to the surfels; scene units
};

// Sorts along a space-filling curve by the points at that distance. Equal keys keep the caller's order.
void order_rays(const Bvh& bvh, const Rays& rays, RayOrder& order);

}  // namespace traceflow::trace
