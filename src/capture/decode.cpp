#include "capture/decode.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "capture/lens/resample.h"
#include "files/image.h"
#include "files/limits.h"
#include "files/npy.h"
#include "files/png.h"

namespace traceflow {

namespace {

// The view's grid over an image of this view that is stored at another size.
Grid grid_over(const ViewSource& view, const Tensor<float>& image) {
  return {view.width(), view.height(), static_cast<double>(image.dim(1)) / view.lens.width * view.factor,
          static_cast<double>(image.dim(0)) / view.lens.height * view.factor};
}

Tensor<float> to_view_grid(const ViewSource& view, Tensor<float> image) {
  if (!view.lens.is_pinhole()) {
    const Lens lens = view.lens.resized(static_cast<double>(image.dim(1)), static_cast<double>(image.dim(0)));
    image = straighten(image, lens, view.zoom);
  }
  return resample(image, grid_over(view, image));
}

// Sets normals that are too short or not finite to zero and normalises the others.
void normalise(Tensor<float>& normals) {
  constexpr float shortest = 0.1F;
  for (int64_t i = 0; i < normals.size(); i += 3) {
    const Vec3<float> n = load3<float>(&normals[i]);
    const float length = glm::length(n);
    // Also false for NaN.
    const bool is_direction = length > shortest && std::isfinite(length);
    store3(&normals[i], is_direction ? n / length : Vec3<float>(0));
  }
}

Tensor<float> normals_on_view_grid(const ViewSource& view, Tensor<float> normals) {
  normalise(normals);
  normals = to_view_grid(view, std::move(normals));
  normalise(normals);
  return normals;
}

Tensor<float> read_normal_image(const TreeFile& file) {
  return normals_of_picture(read_image16(file.open()), file.name());
}

NpyFile open_depth(const TreeFile& file) {
  NpyFile array(file.open());
  const Shape& shape = array.shape();
  if (shape.elements() == 0 || !(shape.rank() == 2 || (shape.rank() == 3 && shape[2] == 1)))
    throw InputError(file.name(), "shape", shape.to_string(), "H×W");
  if (!is_image_size(shape[1], shape[0]))
    throw InputError(file.name(), "shape", shape.to_string(), image_size_limits, "scale the depths down");
  return array;
}

Tensor<float> read_depth(const TreeFile& file) {
  const Tensor<float> depth = open_depth(file).read();
  constexpr float farthest = 1e6F;
  Tensor<float> result({depth.dim(0), depth.dim(1), 1});
  for (int64_t i = 0; i < depth.size(); ++i) {
    result[i] = depth[i] > 0 && depth[i] < farthest ? depth[i] : 0.0F;
  }
  return result;
}

// Mean of the known depths in each pixel of the view.
Tensor<float> depth_on_view_grid(const ViewSource& view, Tensor<float> depth, float scale) {
  if (!view.lens.is_pinhole()) {
    const Lens lens = view.lens.resized(static_cast<double>(depth.dim(1)), static_cast<double>(depth.dim(0)));
    depth = straighten_nearest(depth, lens, view.zoom);
  }
  Tensor<float> exists(depth.shape());
  for (int64_t i = 0; i < depth.size(); ++i) exists[i] = depth[i] > 0 ? 1.0F : 0.0F;
  const Tensor<float> sum = resample(depth, grid_over(view, depth));
  const Tensor<float> share = resample(exists, grid_over(view, depth));
  Tensor<float> result({view.height(), view.width()});
  for (int64_t i = 0; i < result.size(); ++i) result[i] = share[i] >= 0.5F ? scale * sum[i] / share[i] : 0.0F;
  return result;
}

bool has_alpha(const Tensor<uint8_t>& pixels) { return pixels.dim(2) == 2 || pixels.dim(2) == 4; }

// RGB of an image with one to four channels, blended over a grey background.
Tensor<uint8_t> over(uint8_t background, const Tensor<uint8_t>& pixels) {
  const int64_t stored = pixels.dim(2), step = stored >= 3 ? 1 : 0;
  Tensor<uint8_t> rgb;
  rgb.resize({pixels.dim(0), pixels.dim(1), 3});
  for (int64_t i = 0; i < rgb.size() / 3; ++i) {
    const uint8_t* pixel = &pixels[stored * i];
    const int alpha = has_alpha(pixels) ? pixel[stored - 1] : 255;
    for (int64_t c = 0; c < 3; ++c) {
      rgb[3 * i + c] =
          static_cast<uint8_t>((pixel[c * step] * alpha + background * (255 - alpha) + 127) / 255);
    }
  }
  return rgb;
}

// 1 where all stored pixels below a pixel of the view are opaque; empty if that holds everywhere.
Tensor<uint8_t> opaque(const ViewSource& view, const Tensor<uint8_t>& pixels) {
  if (!has_alpha(pixels)) return {};
  const int64_t stored = pixels.dim(2);
  Tensor<float> alpha({pixels.dim(0), pixels.dim(1), 1});
  for (int64_t i = 0; i < alpha.size(); ++i) alpha[i] = pixels[stored * i + stored - 1] == 255 ? 1.0F : 0.0F;
  alpha = to_view_grid(view, std::move(alpha));
  constexpr float whole = 0.999F;
  Tensor<uint8_t> known({view.height(), view.width()});
  bool all = true;
  for (int64_t i = 0; i < known.size(); ++i) {
    known[i] = alpha[i] > whole ? 1 : 0;
    all = all && known[i] == 1;
  }
  return all ? Tensor<uint8_t>() : known;
}

}  // namespace

Tensor<float> normals_of_picture(const Tensor<uint16_t>& picture, const std::string& name) {
  // Longer than any unit vector: black and white mean "no value".
  constexpr float longest = 1.5F, full = 65535;
  const int64_t channels = picture.dim(2);
  if (channels < 3) throw InputError(name, "channels", std::to_string(channels), "3 (normals as 2v - 1)");
  Tensor<float> normals({picture.dim(0), picture.dim(1), 3});
  for (int64_t i = 0; i < normals.size() / 3; ++i) {
    const Vec3<float> n = 2.0F * load3<float>(&picture[i * channels]) / full - 1.0F;
    store3(&normals[3 * i], glm::length(n) < longest ? n : Vec3<float>(0));
  }
  return normals;
}

Vec2<double> depth_size(const TreeFile& file) {
  const Shape shape = open_depth(file).shape();
  return {static_cast<double>(shape[1]), static_cast<double>(shape[0])};
}

DecodedColour decode_colour(const ViewSource& view) {
  const Tensor<uint8_t> pixels = read_image(view.image.open());
  if (pixels.dim(1) != static_cast<int64_t>(view.lens.width) ||
      pixels.dim(0) != static_cast<int64_t>(view.lens.height)) {
    throw InputError(view.image.name(), "size", pixels.shape().to_string(),
                     "the size it had when the capture was opened");
  }
  DecodedColour result{over(view.background, pixels), {}};
  if (view.transparent_is_unknown) result.known = opaque(view, pixels);
  if (!view.lens.is_pinhole() || view.factor != 1)
    result.colour = to_8bit(to_view_grid(view, from_8bit(result.colour)));
  return result;
}

DecodedMask decode_mask(const ViewSource& view) {
  const Tensor<uint8_t> pixels = read_image(view.mask.open());
  Tensor<float> mask({pixels.dim(0), pixels.dim(1), 1});
  for (int64_t i = 0; i < mask.size(); ++i) {
    const bool white = pixels[i * pixels.dim(2)] >= 128;
    mask[i] = white != view.mask_is_inverted ? 1.0F : 0.0F;
  }
  mask = to_view_grid(view, std::move(mask));
  const Shape size{view.height(), view.width()};
  DecodedMask result{Tensor<uint8_t>(size), Tensor<uint8_t>(size)};
  for (int64_t i = 0; i < mask.size(); ++i) {
    result.mask[i] = mask[i] >= 0.5F ? 1 : 0;
    result.coverage[i] = static_cast<uint8_t>(std::lround(255 * std::clamp(mask[i], 0.0F, 1.0F)));
  }
  return result;
}

Tensor<float> decode_prior(const ViewSource& view, const CaptureSource& capture) {
  return normals_on_view_grid(view, view.prior_slice >= 0 ? capture.prior_array->slice(view.prior_slice)
                                                          : read_normal_image(view.prior));
}

Tensor<float> decode_depth(const ViewSource& view, const CaptureSource& capture) {
  return depth_on_view_grid(view, read_depth(view.depth), static_cast<float>(capture.scale));
}

ViewTruth decode_truth(const ViewSource& view, const CaptureSource& capture) {
  ViewTruth truth;
  if (view.truth_normal) truth.normal = normals_on_view_grid(view, read_normal_image(view.truth_normal));
  if (view.truth_depth) {
    truth.depth = depth_on_view_grid(view, read_depth(view.truth_depth), static_cast<float>(capture.scale));
  }
  return truth;
}

void turn_to_world(Tensor<float>& normals, const ViewSource& view, const Vec3<double>& signs) {
  const Mat3<float> world_from_camera(transpose(view.camera_from_world));
  const Vec3<float> opencv_from_prior(signs);
  for (int64_t i = 0; i < normals.size(); i += 3) {
    store3(&normals[i], world_from_camera * (opencv_from_prior * load3<float>(&normals[i])));
  }
}

}  // namespace traceflow
