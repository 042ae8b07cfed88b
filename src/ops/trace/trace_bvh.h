#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "ops/trace/trace.h"

// The tree that the tracer traverses: nodes of 16 boxes above leaves of 16 disks. Each coordinate is a
// separate array, so that a ray is tested against 16 boxes or 16 disks at once.
namespace traceflow::trace {

inline constexpr int bvh_width = 16;

// Hits beyond this distance are ignored. Less than infinity, where the boxes of unused children are.
inline constexpr float farthest_distance = 1e30F;

// A child is a node or a leaf; the top bit is set for a leaf.
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
  float radius[bvh_width];       // of a bounding sphere; scene units
  uint32_t surfel[bvh_width];
  float lower[3], upper[3];  // the bounding box of all disks
};

// The depth at which the builder starts to halve, the largest depth, and the largest number of entries on the
// stack of a traversal.
inline constexpr int bvh_max_free_depth = 40;
inline constexpr int bvh_max_depth = bvh_max_free_depth + 28;
inline constexpr int bvh_stack = bvh_max_depth * (bvh_width - 1) + 1;

namespace cuda {
struct Tree;
}  // namespace cuda

class Bvh {
 public:
  // Empty if no surfel can be hit. Node 0 is the root.
  std::vector<BvhNode> nodes;
  std::vector<BvhLeaf> leaves;
  int64_t surfels = 0;  // size of the set that it was built from
  float leaf_size = 0;  // of a typical leaf: half the diagonal of its box; scene units
  // Replaces all of the above if built on the CUDA device. Shared with backward(), which may trace again.
  std::shared_ptr<cuda::Tree> on_device;
};

}  // namespace traceflow::trace
