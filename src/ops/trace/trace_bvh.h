#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "ops/trace/trace.h"

// What the tracer walks: nodes of 16 boxes above leaves of 16 disks, each held coordinate by coordinate, so
// that a ray meets 16 boxes or 16 disks at once.
namespace traceflow::trace {

inline constexpr int bvh_width = 16;

// No hit lies farther. Less than infinity, where the boxes of unused children are.
inline constexpr float farthest_distance = 1e30F;

// A child is a node or a leaf, told apart by the top bit.
inline constexpr uint32_t leaf_bit = 0x80000000U;

struct alignas(64) BvhNode {
  float lower[3][bvh_width];  // an unused child has lower = +inf, upper = -inf
  float upper[3][bvh_width];
  uint32_t child[bvh_width];
};

struct alignas(64) BvhLeaf {
  float position[3][bvh_width];
  float u[3][bvh_width];  // t_u / scale
  float v[3][bvh_width];  // t_v / scale
  float normal[3][bvh_width];
  float log_opacity[bvh_width];  // -inf in an unused slot
  float radius[bvh_width];       // of a sphere around the disk; scene units
  uint32_t surfel[bvh_width];
  float lower[3], upper[3];  // the box of all
};

// Depth at which the builder turns to halving, and the most entries that a walk then has waiting.
inline constexpr int bvh_max_free_depth = 40;
inline constexpr int bvh_max_depth = bvh_max_free_depth + 28;
inline constexpr int bvh_stack = bvh_max_depth * (bvh_width - 1) + 1;

namespace cuda {
struct Tree;
}  // namespace cuda

class Bvh {
 public:
  // Empty where no surfel can be hit; node 0 is the root.
  std::vector<BvhNode> nodes;
  std::vector<BvhLeaf> leaves;
  int64_t surfels = 0;  // of the set that it was built from
  float leaf_size = 0;  // of a typical leaf: half its box's diagonal; scene units
  // In the place of all that where it was built on the CUDA device. Shared with what backward traces again.
  std::shared_ptr<cuda::Tree> on_device;
};

}  // namespace traceflow::trace
