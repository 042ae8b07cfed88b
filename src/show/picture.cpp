#include "show/picture.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "files/png.h"

namespace traceflow::show {

namespace {

bool shown(float v) { return std::isfinite(v) && v != 0; }

Tensor<float> inverse(const Tensor<float>& depth) {
  Tensor<float> result(depth.shape());
  std::transform(depth.data(), depth.data() + depth.size(), result.data(),
                 [](float z) { return shown(z) ? 1 / z : 0.0F; });
  return result;
}

Tensor<float> halved(const Tensor<float>& normal) {
  Tensor<float> result(normal.shape());
  for (int64_t i = 0; i < normal.size(); i += 3) {
    if (!shown(normal[i]) && !shown(normal[i + 1]) && !shown(normal[i + 2])) continue;
    for (int64_t c = i; c < i + 3; ++c) result[c] = 0.5F + 0.5F * normal[c];
  }
  return result;
}

}  // namespace

Vec3<float> ramp_colour(float value) {
  constexpr std::array<std::array<float, 3>, 6> stops = {{{0.18F, 0.06F, 0.30F},
                                                          {0.20F, 0.22F, 0.53F},
                                                          {0.12F, 0.44F, 0.56F},
                                                          {0.16F, 0.63F, 0.50F},
                                                          {0.52F, 0.80F, 0.32F},
                                                          {0.98F, 0.93F, 0.42F}}};
  const float place = std::clamp(value, 0.0F, 1.0F) * 5;
  const auto low = std::min<size_t>(4, static_cast<size_t>(place));
  return mix(load3<float>(stops[low].data()), load3<float>(stops[low + 1].data()),
             place - static_cast<float>(low));
}

Painter::Range Painter::range_of(const Tensor<float>& values) {
  std::vector<float> seen;
  for (const float v : values.values()) {
    if (shown(v)) seen.push_back(v);
  }
  if (seen.empty()) return {0, 1};
  // Two percent at either end are left to be clamped: a single stray hit would take the whole range.
  const auto at = [&](size_t percent) {
    const auto place = seen.begin() + static_cast<std::ptrdiff_t>(((seen.size() - 1) * percent + 50) / 100);
    std::nth_element(seen.begin(), place, seen.end());
    return *place;
  };
  const float low = at(2), high = at(98);
  return {low, high > low ? high : low + 1};
}

Tensor<uint8_t> Painter::ramp(const Tensor<float>& values, Range range) {
  Tensor<float> colours(Shape{values.dim(0), values.dim(1), 3});
  for (int64_t i = 0; i < values.size(); ++i) {
    if (shown(values[i]))
      store3(colours.data() + 3 * i, ramp_colour((values[i] - range.low) / (range.high - range.low)));
  }
  return to_8bit(colours);
}

Tensor<uint8_t> Painter::paint(Layer layer, const Tensor<float>& values) {
  switch (layer) {
    case Layer::normal:
      return to_8bit(halved(values));
    case Layer::depth:
    case Layer::median_depth: {
      const Tensor<float> nearness = inverse(values);
      if (!inverse_depth_) inverse_depth_ = range_of(nearness);
      return ramp(nearness, *inverse_depth_);
    }
    case Layer::distortion:
      if (!distortion_) distortion_ = range_of(values);
      return ramp(values, *distortion_);
    default:
      return to_8bit(values);
  }
}

Tensor<uint8_t> shrink(const Tensor<uint8_t>& image, int64_t width) {
  const int64_t h = image.dim(0), w = image.dim(1);
  if (w <= width) return image;
  const int64_t height = std::max<int64_t>(1, h * width / w);
  Tensor<uint8_t> small;
  small.resize({height, width, 3});
  for (int64_t i = 0; i < height; ++i) {
    for (int64_t j = 0; j < width; ++j) {
      const int64_t top = i * h / height, bottom = std::max(top + 1, (i + 1) * h / height);
      const int64_t left = j * w / width, right = std::max(left + 1, (j + 1) * w / width);
      for (int64_t c = 0; c < 3; ++c) {
        int64_t sum = 0;
        for (int64_t y = top; y < bottom; ++y) {
          for (int64_t x = left; x < right; ++x) sum += image(y, x, c);
        }
        const int64_t count = (bottom - top) * (right - left);
        small(i, j, c) = static_cast<uint8_t>((sum + count / 2) / count);
      }
    }
  }
  return small;
}

Tensor<uint8_t> in_colour(const Tensor<uint8_t>& image) {
  if (image.shape().rank() == 3) return image;
  Tensor<uint8_t> result;
  result.resize({image.dim(0), image.dim(1), 3});
  for (int64_t i = 0; i < result.size(); ++i) result[i] = image[i / 3];
  return result;
}

}  // namespace traceflow::show
