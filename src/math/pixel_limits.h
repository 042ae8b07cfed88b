#pragma once

namespace traceflow {

// Bounds of the values in pixels of a camera file, and of factors that they are multiplied by: single
// precision can still represent them after some arithmetic.
inline constexpr double largest_pixels = 1e9;
inline constexpr double smallest_pixels = 1e-6;

}  // namespace traceflow
