#pragma once

#include <cstdint>

#include "ops/trace/trace_backward.h"

// The tracer on the CUDA device, and the data that it keeps there. The contract is that of trace.h.
namespace traceflow::trace::cuda {

// A child is a node or a disk; the top bit is set for a disk. All bits are set if there is no child.
inline constexpr uint32_t disk_bit = 0x80000000U;
inline constexpr uint32_t no_child = 0xffffffffU;

// The boxes of two children. An empty box has lower = +inf, upper = -inf.
struct alignas(64) Node {
  float box[3][4];  // per axis: lower and upper of the left child, lower and upper of the right child
  uint32_t child[2];
  uint32_t unused[2];
};

// A surfel as rays are tested against it: first its plane, then the position in the plane.
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

// An order of rays in which the lanes of a warp have similar paths.
struct SortedRays {
  Tensor<uint32_t> order;  // the caller's index of each ray
  Tensor<uint32_t> keys, sorted_keys, indices;
  Tensor<float> frame;  // a typical origin, and the typical distance of the surfels from it
  Tensor<uint8_t> sort_scratch;
};

// A binary tree with one surfel per leaf, in the order of a space-filling curve through their centres.
// Surfels that are left out are at the end, in boxes that no ray meets. Node 0 is the root.
struct Tree {
  int64_t surfels = 0;
  int64_t builds = 0;  // number of builds so far
  Tensor<Node> nodes;
  Tensor<Disk> disks;  // in curve order

  // Memory for building.
  Tensor<uint64_t> keys, sorted_keys;
  Tensor<uint32_t> indices, sorted_indices;
  Tensor<uint32_t> disk_parent, node_parent;  // parent index · 2, plus 1 for a right child
  Tensor<uint32_t> arrived;                   // number of children with a known box, by node
  Tensor<uint32_t> bounds;                    // of the centres
  Tensor<uint8_t> sort_scratch;
  SortedRays rays;  // used if no hits are kept
};

// An element of a list of hits: a blended hit or a head. There is one head in front of the hits of each pass
// of a ray. `name` of a head is the index of the head of the ray's previous pass (no_record if there is
// none). The bits of its `distance` are the number of hits that follow.
struct alignas(16) Record {
  uint32_t name;  // the surfel
  float distance, alpha;
  float transmittance;  // in front of the hit
};
inline constexpr uint32_t no_record = 0xffffffffU;

// The result of blending a ray, with distance in scene units.
struct RaySums {
  float remaining, alpha, distance;
};

// What a hit adds to its surfel, for sums in a fixed order. `passed` times the basis of its ray is dL/dsh.
struct alignas(64) HitParts {
  float part[part::count];
  float passed[3];  // dL/dcolour
  uint32_t ray;     // in the tracer's order
};

// What forward saves for backward. Rays are in the tracer's order.
struct SavedHits {
  static constexpr int64_t unknown = -1;

  int64_t rays = 0;
  SortedRays sorted;
  bool is_sorted = false;
  std::shared_ptr<Tree> tree;
  int64_t builds = 0;               // of the tree at the time of the traversal
  Tensor<Record> records;           // as many as fit
  Tensor<unsigned long long> used;  // number of records wanted
  Tensor<uint32_t> last_head;       // by ray; no_record if it has no hits
  Tensor<uint32_t> hits;            // by ray
  Tensor<RaySums> sums;             // by ray
  // records_wanted: `used` of the last forward pass, or unknown until the host reads it. most_wanted: the
  // largest number read so far.
  int64_t records_wanted = unknown, most_wanted = 0;
  bool overwritten = false;  // by rays that were traced again

  // Memory for backward.
  Tensor<BackwardFrame> frames;
  Tensor<SurfelSums> surfel_sums;
  Tensor<HitParts> parts;  // by record
  Tensor<float> basis;     // by ray, 16 numbers each
  Tensor<uint64_t> keys, sorted_keys;
  Tensor<uint32_t> places, sorted_places;
  Tensor<uint8_t> sort_scratch;
  Tensor<uint32_t> end_surfels[2];  // of the runs at the ends of spans of hits (cuda/sums.cu)
  Tensor<float> end_sums[2];        // of the same runs
};

TRACEFLOW_WITH_CUDA void build(const PosedSurfels& surfels, const Options& options, Bvh& bvh);
TRACEFLOW_WITH_CUDA int64_t blended_hits(const Saved& saved);
TRACEFLOW_WITH_CUDA void forward(const PosedSurfels& surfels, const Bvh& bvh, const Rays& rays,
                                 const Options& options, Output& output, Saved* saved);
TRACEFLOW_WITH_CUDA void backward(const PosedSurfels& surfels, const Rays& rays, const Options& options,
                                  const Saved& saved, const OutputGradient& grad_output,
                                  InputGradient& gradient);

}  // namespace traceflow::trace::cuda
