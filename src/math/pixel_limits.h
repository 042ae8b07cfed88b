#pragma once

namespace traceflow {

// Bounds of what a camera file says in pixels, and of what multiplies it: numbers that single precision holds
// after some arithmetic.
inline constexpr double largest_pixels = 1e9;
inline constexpr double smallest_pixels = 1e-6;

}  // namespace traceflow
