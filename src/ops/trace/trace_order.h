#pragma once

#include <cstdint>
#include <vector>

#include "ops/trace/trace_bvh.h"

namespace traceflow::trace {

// Rays in an order in which neighbours go the same way, whatever order they came in.
struct RayOrder {
  std::vector<uint32_t> ray;  // those that cannot be traced last
  float sample_distance = 0;  // how far from the rays the surfels typically are; scene units
};

// Sorts along a space-filling curve by the points at that distance. Equal ones stay in the caller's order.
void order_rays(const Bvh& bvh, const Rays& rays, RayOrder& order);

}  // namespace traceflow::trace
