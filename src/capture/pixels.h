#pragma once

#include <memory>
#include <optional>

#include "capture/capture.h"

namespace traceflow {

// A view's pixels in their compact, cached form. Tensors that the capture lacks are empty.
struct ViewPixels {
  Tensor<uint8_t> colour;        // H×W×3
  Tensor<uint8_t> known;         // H×W, 0 and 1; empty if all pixels are known
  Tensor<uint8_t> mask;          // H×W
  Tensor<uint8_t> coverage;      // H×W, 255 if the mask covers the whole pixel
  Tensor<int16_t> normal_prior;  // H×W×3, unit normals times 32767
  Tensor<float> depth_prior;     // H×W, camera z in scene units, 0 if unknown

  int64_t bytes() const {
    return colour.size() + known.size() + mask.size() + coverage.size() + 2 * normal_prior.size() +
           4 * depth_prior.size();
  }
  // The same pixels on a device.
  ViewPixels on(Device device) const {
    return {colour.on(device),   known.on(device),        mask.on(device),
            coverage.on(device), normal_prior.on(device), depth_prior.on(device)};
  }
};

// Converts the pixels, on their device, to numbers in [0, 1] and to unit or zero normals. Resizes `images`
// and places them there. prior_turn: the view's. If with_coverage is false, the coverage stays empty.
void widen(const ViewPixels& pixels, const std::optional<Mat3<float>>& prior_turn, ViewImages& images,
           bool with_coverage = true);

// Copies the rendered colours (H×W×3, on the images' device) to unknown pixels of the photograph, so that
// these have no error.
void take_unknown(const Tensor<float>& rendered, ViewImages& images);
// Sets the gradient by the rendered colours (H×W×3) to zero at unknown pixels, where it comes from
// neighbouring pixels only.
void leave_unknown(const ViewImages& images, Tensor<float>& grad_colour);

// Like load_images, but does not widen.
std::shared_ptr<const ViewPixels> load_pixels(const Capture& capture, const View& view);

}  // namespace traceflow
