#pragma once

#include <cstdint>

// Limits that are checked before a file's contents are read.
namespace traceflow {

// In pixels, for images and for arrays over one.
constexpr int64_t max_image_side = 32768;
constexpr int64_t max_image_pixels = int64_t{1} << 28;
constexpr bool is_image_size(int64_t width, int64_t height) {
  return width <= max_image_side && height <= max_image_side && width * height <= max_image_pixels;
}
inline constexpr const char* image_size_limits = "at most 32,768 pixels a side and 2²⁸ in all";
// Points of a capture. So many take two gigabytes while they are read from COLMAP's files, which have the
// most data per point.
constexpr int64_t max_capture_points = 10'000'000;
// Deflate cannot expand data by more than this. A header that promises more than the file can hold is
// rejected before memory is allocated.
constexpr int64_t max_inflation = 1032;

}  // namespace traceflow
