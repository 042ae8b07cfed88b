#include "base/parallel.h"
#include "base/sort.h"
#include "ops/surface/surface.h"
#include "ops/surface/surface_kernels.h"

namespace traceflow::surface {

namespace {

void select_on_host(const TraceWeight& weight_of, int64_t size, TracedPixels& traced) {
  traced.pixel.place(Device::cpu).resize({size});
  traced.weight.place(Device::cpu).resize({size});
  int64_t count = 0;
  for (int64_t pixel = 0; pixel < size; ++pixel) {
    const float weight = weight_of(pixel);
    if (weight == 0) continue;
    traced.pixel[count] = static_cast<int32_t>(pixel);
    traced.weight[count++] = weight;
  }
  traced.pixel.resize({count});
  traced.weight.resize({count});
}

// Lists have room for every pixel, so that their memory stays where it is whatever their number. The host
// waits for that number: the rays that follow are as many.
void select_on_device(const TraceWeight& weight_of, int64_t size, TracedPixels& traced) {
  static thread_local Tensor<int32_t> place;
  static thread_local Tensor<uint8_t> scratch;
  place.place(Device::cuda).resize({size + 1});
  parallel_for(Device::cuda, "surface: flag traced pixels", size + 1,
               FlagTraced{weight_of, size, place.data()});
  cuda::exclusive_sum(place.data(), place.data(), size + 1, scratch);
  traced.pixel.place(Device::cuda).resize({size});
  traced.weight.place(Device::cuda).resize({size});
  parallel_for(Device::cuda, "surface: list traced pixels", size,
               ListTraced{weight_of, place.data(), traced.pixel.data(), traced.weight.data()});
  int32_t count = 0;
  memory::copy(Device::cpu, &count, Device::cuda, place.data() + size, sizeof(count));
  traced.pixel.resize({count});
  traced.weight.resize({count});
}

}  // namespace

void SelectOptions::validate() const {
  check_option(min_alpha >= 0 && min_alpha <= 1, "select.min_alpha", min_alpha, "0 to 1");
  check_option(min_tint >= 0 && min_tint <= 1, "select.min_tint", min_tint, "0 to 1");
  check_option(probe_share >= 0 && probe_share <= 1, "select.probe_share", probe_share, "0 to 1");
}

void select_pixels(const Tensor<float>& alpha, const Tensor<float>& tint, const Tensor<float>& normal,
                   const SelectOptions& options, bool probes, uint64_t seed, TracedPixels& traced) {
  require(tint.shape() == alpha.shape() && normal.size() == 3 * alpha.size(),
          "alpha, tint and normal show the same picture", alpha.shape().to_string());
  const TraceWeight weight{alpha.data(),     tint.data(),         normal.data(), options.min_alpha,
                           options.min_tint, options.probe_share, probes,        seed};
  if (alpha.device() == Device::cuda) {
    select_on_device(weight, alpha.size(), traced);
  } else {
    select_on_host(weight, alpha.size(), traced);
  }
}

}  // namespace traceflow::surface
