#pragma once

#include <memory>
#include <optional>

#include "capture/capture.h"

namespace traceflow {

// A view's pixels as they are kept: small. Tensors that the capture lacks are empty.
struct ViewPixels {
  Tensor<uint8_t> colour;        // H×W×3
  Tensor<uint8_t> known;         // H×W, 0 and 1; empty where all is known
  Tensor<uint8_t> mask;          // H×W
  Tensor<uint8_t> coverage;      // H×W, 255 where the mask covers all of a pixel
  Tensor<int16_t> normal_prior;  // H×W×3, unit normals times 32767

  int64_t bytes() const {
    return colour.size() + known.size() + mask.size() + coverage.size() + 2 * normal_prior.size();
  }
  // The same pixels on a device.
  ViewPixels on(Device device) const {
    return {colour.on(device), known.on(device), mask.on(device), coverage.on(device),
            normal_prior.on(device)};
  }
};

// Numbers of [0, 1] and unit or zero normals again, where the pixels are; `images` is resized and put there.
// prior_turn: the view's. Without with_coverage its coverage stays empty.
void widen(const ViewPixels& pixels, const std::optional<Mat3<float>>& prior_turn, ViewImages& images,
           bool with_coverage = true);

// Where a photograph says nothing it takes the colours that were rendered (H×W×3, where the images are): what
// is not known is no error.
void take_unknown(const Tensor<float>& rendered, ViewImages& images);
// What a gradient by the rendered colours (H×W×3) says of unknown pixels, through their neighbours alone,
// goes.
void leave_unknown(const ViewImages& images, Tensor<float>& grad_colour);

// As load_images, without widening.
std::shared_ptr<const ViewPixels> load_pixels(const Capture& capture, const View& view);

}  // namespace traceflow
