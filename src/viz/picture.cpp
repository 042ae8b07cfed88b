#include "viz/picture.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "base/robust.h"
#include "files/png.h"

namespace traceflow::viz {

namespace {

bool shown(float v) { return std::isfinite(v) && v != 0; }

Tensor<float> inverse(const Tensor<float>& depth) {
  Tensor<float> result(depth.shape());
  std::ranges::transform(depth.values(), result.data(), [](float z) { return shown(z) ? 1 / z : 0.0F; });
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

std::optional<Painter::Range> Painter::range_of(const Tensor<float>& values) {
  std::vector<float> seen;
  for (const float v : values.values()) {
    if (shown(v)) seen.push_back(v);
  }
  if (seen.empty()) return std::nullopt;
  // Two percent at each end are clamped, so that single outliers do not determine the range.
  const auto at = [&](size_t percent) { return ranked(seen, ((seen.size() - 1) * percent + 50) / 100); };
  const float low = at(2), high = at(98);
  return Range{low, high > low ? high : low + 1};
}

Painter::Range Painter::followed(std::optional<Range>& range, const Tensor<float>& values) const {
  if (range && options_.follow <= 0) return *range;
  const std::optional<Range> own = range_of(values);
  if (!range) {
    // A picture without any value does not set the range, unless later ones must keep the first range.
    if (!own && options_.follow > 0) return {0, 1};
    range = own.value_or(Range{0, 1});
  } else if (own) {
    const float share = std::min(options_.follow, 1.0F);
    range->low = std::lerp(range->low, own->low, share);
    range->high = std::lerp(range->high, own->high, share);
  }
  return *range;
}

Tensor<uint8_t> Painter::mapped(const Tensor<float>& values, Range range, bool zero_is_none) const {
  const ColourMap map = options_.map.value_or(ColourMap::ramp);
  Tensor<float> colours(Shape{values.dim(0), values.dim(1), 3});
  parallel_for("viz: map numbers to colours", values.size(), [&](int64_t i) {
    const bool none = !std::isfinite(values[i]) || (zero_is_none && values[i] == 0);
    if (!none)
      store3(colours.data() + 3 * i, map_colour(map, (values[i] - range.low) / (range.high - range.low)));
  });
  return to_8bit(colours);
}

Tensor<uint8_t> Painter::paint(Layer layer, const Tensor<float>& values) {
  switch (layer) {
    case Layer::normal:
      return to_8bit(halved(values));
    case Layer::depth:
    case Layer::median_depth: {
      const Tensor<float> nearness = inverse(values);
      return mapped(nearness, followed(inverse_depth_, nearness), true);
    }
    case Layer::distortion:
      return mapped(values, followed(distortion_, values), true);
    case Layer::tint:
    case Layer::roughness:
    case Layer::alpha:
      return options_.map ? mapped(values, {0, 1}, false) : to_8bit(values);
    case Layer::rgb:
    case Layer::diffuse:
    case Layer::specular:
    case Layer::surfels:
    case Layer::tracks:
      break;
  }
  if (options_.exposure == 0) return to_8bit(values);
  Tensor<float> exposed = values;
  const float gain = std::exp2(options_.exposure);
  for (float& v : exposed.values()) v *= gain;
  return to_8bit(exposed);
}

Tensor<uint8_t> Painter::paint_difference(const Tensor<float>& values) const {
  return mapped(values, {0, 0.25F / std::exp2(options_.exposure)}, false);
}

Tensor<uint8_t> shrink(const Tensor<uint8_t>& image, int64_t width, int64_t height) {
  const int64_t h = image.dim(0), w = image.dim(1);
  if (w <= width && h <= height) return image;
  width = std::min(width, w);
  const int64_t in_proportion = std::max<int64_t>(1, h * width / w);
  if (in_proportion <= height) {
    height = in_proportion;
  } else {
    width = std::max<int64_t>(1, w * height / h);
  }
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

Tensor<uint8_t> side_by_side(const Tensor<uint8_t>& left, const Tensor<uint8_t>& right) {
  if (left.dim(0) != right.dim(0)) {
    throw InputError("pictures", "",
                     "heights of " + std::to_string(left.dim(0)) + " and " + std::to_string(right.dim(0)),
                     "one height, to stand side by side");
  }
  Tensor<uint8_t> both(Shape{left.dim(0), left.dim(1) + right.dim(1), 3});
  for (int64_t y = 0; y < both.dim(0); ++y) {
    std::copy(left.row(y), left.row(y) + left.row_size(), both.row(y));
    std::copy(right.row(y), right.row(y) + right.row_size(), both.row(y) + left.row_size());
  }
  return both;
}

Tensor<uint8_t> in_colour(const Tensor<uint8_t>& image) {
  if (image.shape().rank() == 3) return image;
  Tensor<uint8_t> result;
  result.resize({image.dim(0), image.dim(1), 3});
  for (int64_t i = 0; i < result.size(); ++i) result[i] = image[i / 3];
  return result;
}

}  // namespace traceflow::viz
