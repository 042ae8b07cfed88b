#include "ops/trace/cuda/forward.h"
#include "ops/trace/trace_ray_key.h"
#include "primitives/sort.h"

// Orders rays like trace_order.cpp on the CPU, but without groups.
namespace traceflow::trace::cuda {

using namespace traceflow::cuda;

namespace {

constexpr int samples = 256;
constexpr int order_threads = 256;

// One number per thread of the block, and their median.
struct Median {
  float value[samples];
  float middle;
};

// The median of the numbers of the threads with `has`; 0 if there is none. All threads take part.
__device__ float find_median(Median& shared, float own, bool has) {
  const int me = static_cast<int>(threadIdx.x);
  shared.value[me] = has ? own : INFINITY;
  if (me == 0) shared.middle = 0;
  const int count = __syncthreads_count(has ? 1 : 0);
  int before = 0;
  for (int i = 0; i < samples; ++i) {
    before += shared.value[i] < own || (shared.value[i] == own && i < me) ? 1 : 0;
  }
  if (has && before == count / 2) shared.middle = own;
  __syncthreads();
  const float middle = shared.middle;
  __syncthreads();
  return middle;
}

// Medians of samples, which outliers among rays and surfels do not affect. One block.
__global__ void __launch_bounds__(samples) find_frame(RayInput input, int64_t surfels, float* frame) {
  __shared__ Median shared;
  const int64_t r = input.last * threadIdx.x / samples;
  const bool traceable = is_traceable(input.rays.origins + 3 * r, input.rays.directions + 3 * r);
  Vec3<float> centre;
  for (int axis = 0; axis < 3; ++axis) {
    centre[axis] = find_median(shared, input.rays.origins[3 * r + axis], traceable);
  }
  const DiskPlane disk = load_quads(input.disks[surfels * threadIdx.x / samples].plane);
  const float distance = glm::length(disk.position - centre);
  const float median_distance =
      find_median(shared, distance, disk.log_opacity > -INFINITY && std::isfinite(distance));
  if (threadIdx.x != 0) return;
  store3(frame, centre);
  frame[3] = median_distance > 0 ? median_distance : 1;
}

__global__ void __launch_bounds__(order_threads)
    make_ray_keys(RayInput input, const float* frame, uint32_t* keys, uint32_t* indices) {
  const int64_t r = input.own();
  if (r >= input.last) return;
  keys[r] = ray_key(input.rays, r, load3<float>(frame), frame[3]);
  indices[r] = static_cast<uint32_t>(r);
}

}  // namespace

const uint32_t* sort_rays(const RayInput& input, int64_t surfels, SortedRays& rays) {
  const int64_t count = input.last;
  for (auto* tensor : {&rays.keys, &rays.sorted_keys, &rays.indices, &rays.order}) {
    tensor->place(Device::cuda).resize({count});
  }
  rays.frame.place(Device::cuda).resize({4});
  launch("trace: ray frame", {1, samples}, find_frame, input, surfels, rays.frame.data());
  launch("trace: ray keys", {blocks_for(count, order_threads), order_threads}, make_ray_keys, input,
         rays.frame.data(), rays.keys.data(), rays.indices.data());
  sort_pairs(count, ray_key_bits, rays.keys.data(), rays.sorted_keys.data(), rays.indices.data(),
             rays.order.data(), rays.sort_scratch);
  return rays.order.data();
}

}  // namespace traceflow::trace::cuda
