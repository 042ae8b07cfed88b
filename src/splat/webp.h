#pragma once

#include <string>

#include "base/tensor.h"

namespace traceflow {

// A lossless WebP image of an H×W×4 tensor (RGBA). Keeps the colours of transparent pixels. Throws
// InternalError above 16,383 pixels a side, which the format does not allow.
std::string webp_bytes(const Tensor<uint8_t>& image);

}  // namespace traceflow
