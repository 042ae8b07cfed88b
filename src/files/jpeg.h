#pragma once

#include <string>

#include "base/tensor.h"

namespace traceflow {

// A JPEG file's bytes. pixels: H×W (grey) or H×W×3, of 1 to 65,500 pixels a side (else InputError); quality:
// 1 to 100. From 90 on colours keep the full resolution, below they are halved and faster arithmetic is used.
std::string jpeg_bytes(const Tensor<uint8_t>& pixels, int quality);

}  // namespace traceflow
