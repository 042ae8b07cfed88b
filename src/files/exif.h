#pragma once

#include <cstddef>
#include <span>

namespace traceflow {

// The orientation that an APP1 segment of a JPEG tells, 1 (as stored) to 8; 1 where it tells none or is
// broken. An orientation of 5 or more swaps the picture's sides.
int exif_orientation(std::span<const std::byte> segment);

}  // namespace traceflow
