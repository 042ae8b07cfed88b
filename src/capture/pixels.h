#pragma once

#include <memory>

#include "capture/capture.h"

namespace traceflow {

// A view's pixels as they are kept: small. Tensors that the capture lacks are empty.
struct ViewPixels {
  Tensor<uint8_t> colour;        // H×W×3
  Tensor<uint8_t> mask;          // H×W
  Tensor<int16_t> normal_prior;  // H×W×3, unit normals times 32767

  int64_t bytes() const { return colour.size() + mask.size() + 2 * normal_prior.size(); }
  // The same pixels on a device.
  ViewPixels on(Device device) const { return {colour.on(device), mask.on(device), normal_prior.on(device)}; }
};

// Numbers of [0, 1] and unit or zero normals again, where the pixels are; `images` is resized and put there.
void widen(const ViewPixels& pixels, ViewImages& images);

// As load_images, without widening.
std::shared_ptr<const ViewPixels> load_pixels(const Capture& capture, const View& view);

}  // namespace traceflow
