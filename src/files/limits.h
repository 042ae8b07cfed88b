#pragma once

#include <cstdint>

// What is taken from a file before its contents are looked at.
namespace traceflow {

// Images, and arrays over one: pixels.
constexpr int64_t max_image_side = 32768;
constexpr int64_t max_image_pixels = int64_t{1} << 28;
constexpr bool is_image_size(int64_t width, int64_t height) {
  return width <= max_image_side && height <= max_image_side && width * height <= max_image_pixels;
}
inline constexpr const char* image_size_limits = "at most 32,768 pixels a side and 2²⁸ in all";
// Points of a capture: so many take two gigabytes while they are read from COLMAP's files, which say most of
// each.
constexpr int64_t max_capture_points = 10'000'000;
// Deflate cannot grow data by more than this; a header that promises more than the file can hold is refused
// before its memory is taken.
constexpr int64_t max_inflation = 1032;

}  // namespace traceflow
