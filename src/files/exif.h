#pragma once

#include <cstddef>
#include <span>

namespace traceflow {

// The orientation in an APP1 segment of a JPEG, 1 (as stored) to 8; 1 if there is none or it is broken. An
// orientation of 5 or more swaps width and height.
int exif_orientation(std::span<const std::byte> segment);

}  // namespace traceflow
