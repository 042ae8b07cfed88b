#pragma once

#include <cstdint>

#include "ops/trace/trace_backward.h"

// The tracer on the CUDA device, and what it keeps there; the contract is that of trace.h.
namespace traceflow::trace::cuda {

// A child is a node or a disk, told apart by the top bit. All bits stand for none.
inline constexpr uint32_t disk_bit = 0x80000000U;
inline constexpr uint32_t no_child = 0xffffffffU;

// The boxes of two children. One that holds nothing has lower = +inf, upper = -inf.
struct alignas(64) Node {
  float box[3][4];  // on each axis: lower and upper of the left child, lower and upper of the right one
  uint32_t child[2];
  uint32_t unused[2];
};

// A surfel as a ray meets it: first its plane, then where in it.
struct DiskPlane {
  Vec3<float> position;
  float log_opacity;  // -inf for a surfel that is left out
  Vec3<float> normal;
  uint32_t surfel;
};
struct DiskAxes {
  Vec3<float> u, v;  // t_u / scale, t_v / scale
  float unused[2];
};
struct alignas(64) Disk {
  DiskPlane plane;
  DiskAxes axes;
};

// Rays in an order in which the lanes of a warp go the same way.
struct SortedRays {
  Tensor<uint32_t> order;  // the caller's index of each ray
  Tensor<uint32_t> keys, sorted_keys, indices;
  Tensor<float> frame;  // a typical origin, and how far from it the surfels typically are
  Tensor<uint8_t> sort_scratch;
};

// A binary tree with a surfel in each leaf, in the order of a space-filling curve through their centres.
// Surfels that are left out stand at the end, in boxes that no ray meets. Node 0 is the root.
struct Tree {
  int64_t surfels = 0;
  int64_t builds = 0;  // so far
  Tensor<Node> nodes;
  Tensor<Disk> disks;  // in the order of the curve

  // Room for building.
  Tensor<uint64_t> keys, sorted_keys;
  Tensor<uint32_t> indices, sorted_indices;
  Tensor<uint32_t> disk_parent, node_parent;  // the parent's index · 2, and 1 more for its right child
  Tensor<uint32_t> arrived;                   // children of a node whose boxes are known
  Tensor<uint32_t> bounds;                    // of the centres
  Tensor<uint8_t> sort_scratch;
  SortedRays rays;  // where no hits are kept
};

// One number of a list of hits: a hit as it was blended, or, in front of every pass of a ray, a head: `name`
// is where the head of the ray's pass before stands (no_record for none), and the bits of `distance` are the
// number of hits that follow.
struct alignas(16) Record {
  uint32_t name;  // the surfel
  float distance, alpha;
  float transmittance;  // in front of the hit
};
inline constexpr uint32_t no_record = 0xffffffffU;

// What blending left of a ray, distance in scene units.
struct RaySums {
  float remaining, alpha, distance;
};

// What a hit adds to its surfel, for sums in a fixed order. With the basis of its ray, `passed` gives dL/dsh.
struct alignas(64) HitParts {
  float part[part::count];
  float passed[3];  // dL/dcolour
  uint32_t ray;     // in the tracer's order
};

// What forward keeps for backward. Rays are counted in the tracer's order.
struct SavedHits {
  static constexpr int64_t unknown = -1;

  int64_t rays = 0;
  SortedRays sorted;
  bool is_sorted = false;
  std::shared_ptr<Tree> tree;
  int64_t builds = 0;               // of the tree when it was walked
  Tensor<Record> records;           // as many as have room
  Tensor<unsigned long long> used;  // records that were wanted
  Tensor<uint32_t> last_head;       // of each ray; no_record where it has no hits
  Tensor<uint32_t> hits;            // of each ray
  Tensor<RaySums> sums;             // of each ray
  // What the host has seen of `used` since the last forward pass, unknown until it looks; and before that
  // pass.
  int64_t records_wanted = unknown, most_wanted = 0;
  bool overwritten = false;  // by rays that were traced again

  // Room for backward.
  Tensor<BackwardFrame> frames;
  Tensor<SurfelSums> surfel_sums;
  Tensor<HitParts> parts;  // of each record
  Tensor<float> basis;     // of each ray, 16 numbers
  Tensor<uint64_t> keys, sorted_keys;
  Tensor<uint32_t> places, sorted_places;
  Tensor<uint8_t> sort_scratch;
  Tensor<uint32_t> end_surfels[2];  // of the runs at the ends of spans of hits (cuda/sums.cu)
  Tensor<float> end_sums[2];        // of those
};

TRACEFLOW_WITH_CUDA void build(const PosedSurfels& surfels, const Options& options, Bvh& bvh);
TRACEFLOW_WITH_CUDA int64_t blended_hits(const Saved& saved);
TRACEFLOW_WITH_CUDA void forward(const PosedSurfels& surfels, const Bvh& bvh, const Rays& rays,
                                 const Options& options, Output& output, Saved* saved);
TRACEFLOW_WITH_CUDA void backward(const PosedSurfels& surfels, const Rays& rays, const Options& options,
                                  const Saved& saved, const OutputGradient& grad_output,
                                  InputGradient& gradient);

}  // namespace traceflow::trace::cuda
