#pragma once

#include <cstdint>

// What is taken from a file before its contents are looked at.
namespace traceflow {

// Images: pixels.
constexpr int64_t max_image_side = 32768;
constexpr int64_t max_image_pixels = int64_t{1} << 28;
// Deflate cannot grow data by more than this; a header that promises more than the file can hold is refused
// before its memory is taken.
constexpr int64_t max_inflation = 1032;

}  // namespace traceflow
