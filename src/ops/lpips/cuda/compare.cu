#include "ops/lpips/cuda/compare.h"

#include "base/kernel.h"
#include "ops/lpips/lpips_directions.h"

namespace traceflow::lpips::cuda {

namespace {

using traceflow::cuda::warp_lanes;
using traceflow::cuda::warp_sum;

constexpr int compare_threads = 256;

// One warp per pixel; its lanes share the channels.
__global__ void __launch_bounds__(compare_threads)
    compare_kernel(Features f, double scale, double* distances, float* grad_a) {
  const int lane = static_cast<int>(threadIdx.x) % warp_lanes;
  const int64_t pixel = (int64_t{blockIdx.x} * compare_threads + threadIdx.x) / warp_lanes;
  if (pixel >= f.pixels) return;
  const float* const a = f.a + pixel * f.stride;
  const float* const b = f.b + pixel * f.stride;

  double squares_a = 0, squares_b = 0;
  for (int c = lane; c < f.channels; c += warp_lanes) {
    squares_a += static_cast<double>(a[c]) * static_cast<double>(a[c]);
    squares_b += static_cast<double>(b[c]) * static_cast<double>(b[c]);
  }
  const Directions directions(warp_sum(squares_a), warp_sum(squares_b));

  double distance = 0, along = 0;
  for (int c = lane; c < f.channels; c += warp_lanes) {
    const double difference = directions.difference(a[c], b[c]);
    const double slope = static_cast<double>(f.linear[c]) * difference;
    distance += slope * difference;
    along += slope * static_cast<double>(a[c]);
  }
  distance = warp_sum(distance);
  if (lane == 0) distances[pixel] = distance;

  if (grad_a == nullptr) return;
  const Bend bend(directions, warp_sum(along), scale);
  for (int c = lane; c < f.stride; c += warp_lanes) {
    const bool open = a[c] > 0;
    grad_a[pixel * f.stride + c] =
        open ? bend.gradient(f.linear[c], directions.difference(a[c], b[c]), a[c]) : 0.0F;
  }
}

}  // namespace

void compare(const Features& features, double scale, double* distances, float* grad_a) {
  constexpr int pixels_in_block = compare_threads / warp_lanes;
  traceflow::cuda::launch("lpips: compare",
                          {traceflow::cuda::blocks_for(features.pixels, pixels_in_block), compare_threads},
                          compare_kernel, features, scale, distances, grad_a);
}

}  // namespace traceflow::lpips::cuda
