#include "ops/surface/surface.h"
#include "ops/surface/surface_kernels.h"
#include "primitives/list_where.h"

namespace traceflow::surface {

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
  const Device device = alpha.device();
  list_where(device, "surface: traced pixels", alpha.size(), IsTraced{weight}, traced.pixel);
  const int64_t count = traced.pixel.size();
  if (device != Device::cpu) traced.weight.place(device).resize({alpha.size()});  // same capacity as the list
  traced.weight.place(device).resize({count});
  parallel_for(device, "surface: weights of traced pixels", count,
               ListedWeight{weight, traced.pixel.data(), traced.weight.data()});
}

}  // namespace traceflow::surface
