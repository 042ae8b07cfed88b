#include "ops/surface/surface.h"
#include "ops/surface/surface_kernels.h"

namespace traceflow::surface {

namespace {

// A number in [0, 1) that depends on nothing but the seed and the pixel (the finaliser of splitmix64).
double hashed_uniform(uint64_t seed, int64_t pixel) {
  uint64_t z = seed + 0x9E3779B97F4A7C15ULL * (static_cast<uint64_t>(pixel) + 1);
  z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27U)) * 0x94D049BB133111EBULL;
  z ^= z >> 31U;
  return static_cast<double>(z >> 11U) * 0x1.0p-53;
}

}  // namespace

void SelectOptions::validate() const {
  check_option(min_alpha >= 0 && min_alpha <= 1, "select.min_alpha", min_alpha, "0 to 1");
  check_option(min_tint >= 0 && min_tint <= 1, "select.min_tint", min_tint, "0 to 1");
  check_option(probe_share >= 0 && probe_share <= 1, "select.probe_share", probe_share, "0 to 1");
}

TracedPixels select_pixels(const Tensor<float>& alpha, const Tensor<float>& tint, const Tensor<float>& normal,
                           const SelectOptions& options, bool probes, uint64_t seed) {
  require(tint.shape() == alpha.shape() && normal.size() == 3 * alpha.size(),
          "alpha, tint and normal show the same picture", alpha.shape().to_string());
  std::vector<int32_t> pixels;
  std::vector<float> weights;
  for (int64_t pixel = 0; pixel < alpha.size(); ++pixel) {
    if (!(alpha[pixel] >= options.min_alpha)) continue;
    const Vec3<float> n = load3<float>(normal.data() + 3 * pixel);
    if (n == Vec3<float>(0) || !is_finite(n)) continue;
    const bool matters = tint[pixel] >= options.min_tint;
    const bool probe = !matters && probes && hashed_uniform(seed, pixel) < options.probe_share;
    if (!matters && !probe) continue;
    pixels.push_back(static_cast<int32_t>(pixel));
    weights.push_back(matters ? 1.0F : 1.0F / options.probe_share);
  }
  return {tensor_of(pixels), tensor_of(weights)};
}

}  // namespace traceflow::surface
