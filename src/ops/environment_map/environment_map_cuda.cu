#include <bit>

#include "base/kernel.h"
#include "ops/environment_map/environment_map_cuda.h"
#include "ops/environment_map/environment_map_kernels.h"
#include "primitives/sort.h"

// Sorts rays by the first texel that they use. Each texel sums over its own rays and its neighbours' in
// order, so the result is bitwise reproducible.
namespace traceflow {
namespace environment_map::cuda {

namespace {

// Memory kept between calls; all work is on one stream. Never freed, because the allocator may be destroyed
// first at exit.
struct Scratch {
  Tensor<float> grad_interpolated;
  Tensor<uint32_t> texels, sorted_texels, rays, sorted_rays, first;
  Tensor<uint8_t> sort_scratch;
};

Scratch& scratch() {
  static Scratch* const the_scratch = new Scratch;
  return *the_scratch;
}

}  // namespace

void backward(const Tensor<float>& logit, const Tensor<float>& directions, const Tensor<float>& grad_colour,
              Tensor<float>& grad_logit, Tensor<float>& grad_directions) {
  constexpr Device device = Device::cuda;
  const int64_t count = directions.dim(0), size = logit.dim(1), texels = 6 * size * size;
  Scratch& r = scratch();
  r.grad_interpolated.place(device).resize({count, 3});
  for (auto* tensor : {&r.texels, &r.sorted_texels, &r.rays, &r.sorted_rays}) {
    tensor->place(device).resize({count});
  }
  r.first.place(device).resize({texels + 1});
  parallel_for(device, "environment map: backward by ray", count,
               RayStep<float>{{logit.data(), size},
                              directions.data(),
                              grad_colour.data(),
                              r.grad_interpolated.data(),
                              grad_directions.data(),
                              r.texels.data(),
                              r.rays.data()});
  traceflow::cuda::sort_pairs(count, static_cast<int>(std::bit_width(static_cast<uint64_t>(texels))),
                              r.texels.data(), r.sorted_texels.data(), r.rays.data(), r.sorted_rays.data(),
                              r.sort_scratch);
  parallel_for(device, "environment map: sort", texels + 1,
               FindFirst{r.sorted_texels.data(), count, r.first.data()});
  parallel_for(device, "environment map: backward by texel", texels,
               CollectTexel<float>{size, r.first.data(), r.sorted_rays.data(), directions.data(),
                                   r.grad_interpolated.data(), grad_logit.data()});
}

}  // namespace environment_map::cuda

template void cuda::for_each_index(const char*, int64_t, const environment_map::LookUpColour<float>&);

}  // namespace traceflow
