#pragma once

#include <cstring>

#include "base/kernel.h"
#include "math/blend.h"
#include "ops/trace/cuda/trace.h"

// Steps of the tracer on the device that several .cu files share.
namespace traceflow::trace::cuda {

// Loads a value 16 bytes at a time from memory that no thread writes to during the kernel.
template <class T>
__device__ T load_quads(const T& at) {
  constexpr size_t count = sizeof(T) / sizeof(float4);
  static_assert(count * sizeof(float4) == sizeof(T));
  float4 quads[count];
  for (size_t i = 0; i < count; ++i) quads[i] = __ldg(reinterpret_cast<const float4*>(&at) + i);
  T value;
  std::memcpy(&value, quads, sizeof(T));
  return value;
}
template <class T>
__device__ void store_quads(const T& value, T& at) {
  constexpr size_t count = sizeof(T) / sizeof(float4);
  static_assert(count * sizeof(float4) == sizeof(T));
  float4 quads[count];
  std::memcpy(quads, &value, sizeof(T));
  for (size_t i = 0; i < count; ++i) reinterpret_cast<float4*>(&at)[i] = quads[i];
}

struct TraversalRules {
  BlendRules<float> blend;
  float log_alpha_min;
  float t_min;
  float deviations;  // cone_deviations()

  TraversalRules() = default;
  explicit TraversalRules(const Options& o)
      : blend{o.alpha_min, o.alpha_max, o.transmittance_min},
        log_alpha_min(std::log(o.alpha_min)),
        t_min(o.t_min),
        deviations(cone_deviations(o)) {}
};

// Rays [first, last) in the tracer's order, and what they are traced through. `nodes` is null for an empty
// tree.
struct RayInput {
  const Node* nodes;
  const Disk* disks;
  const float* sh;
  RayView rays;
  const uint32_t* order;  // the caller's index of each ray; null if the orders are the same
  int64_t first, last;
  TraversalRules rules;
  Vec3<float> background;

  // The index of this thread's ray.
  __device__ int64_t own() const { return first + int64_t{blockIdx.x} * blockDim.x + threadIdx.x; }
  __device__ int64_t callers(int64_t i) const { return order ? int64_t{order[i]} : i; }
};

// The outputs of the rays; null if rays are traced for their hits only.
struct RayOutput {
  float *colour, *alpha, *distance;
};

// Where hits are stored. Hits that do not fit are dropped, but counted in `used`.
struct RecordStore {
  bool keep;  // if false, nothing here is used
  Record* records;
  uint64_t capacity;
  unsigned long long* used;
  uint32_t* last_head;
  // Null if rays are traced again.
  uint32_t* hits;
  RaySums* sums;
};

// Sorts all rays. There must be at least one ray and one surfel. Equal keys keep the caller's order.
const uint32_t* sort_rays(const RayInput& input, int64_t surfels, SortedRays& rays);

void trace_rays(int degree, const RayInput& rays, const RayOutput& output, const RecordStore& store);

// The input and output of backward. Hits are in `records`.
struct BackwardTask {
  RayInput rays;
  const Record* records;
  const uint32_t* last_head;
  const RaySums* sums;
  const BackwardFrame* frames;
  const float *grad_colour, *grad_alpha, *grad_distance;  // null means zero
  float *grad_origins, *grad_directions;
  float* grad_widths;  // null if rays have no widths
  // Without `parts`: sums over all hits, added to in any order.
  SurfelSums* surfel_sums;
  float* grad_sh;
  // With `parts`, for sums in a fixed order: the contributions of each hit, by the index of its record. The
  // key sorts hits by surfel and ray.
  HitParts* parts;
  uint64_t* keys;
  uint32_t* places;
  float* basis;
  int ray_bits;
  uint64_t head_key;
};

void trace_backward(int degree, const BackwardTask& task);

// Adds the first `records` elements of `hits.parts` to the sums of their surfels, in the order of the rays.
// `surfels`: the number of surfels.
void sum_in_order(int degree, int64_t records, uint32_t surfels, int ray_bits, SavedHits& hits,
                  SurfelSums* sums, float* grad_sh);

}  // namespace traceflow::trace::cuda
