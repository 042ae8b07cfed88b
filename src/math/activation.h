#pragma once

#include <cmath>

#include "base/device.h"

// The activations of stored values (method §1.1) and their derivatives.
namespace traceflow {

// σ(x) = 1 / (1 + e^-x), without overflow for any x.
template <class T>
TRACEFLOW_HD T sigmoid(T x) {
  const T e = std::exp(-std::abs(x));
  return (x < T(0) ? e : T(1)) / (T(1) + e);
}

// dσ/dx from the value y = σ(x).
template <class T>
TRACEFLOW_HD T sigmoid_derivative(T y) {
  return y * (T(1) - y);
}

// The inverse of sigmoid for y in (0, 1).
template <class T>
TRACEFLOW_HD T logit(T y) {
  return std::log(y) - std::log1p(-y);
}

// The largest roughness. Much wider cones show hardly more than harmonics do, and are slow to trace.
inline constexpr double largest_roughness = 0.25;

// The activation largest_roughness · σ(x), its derivative from the value, and its inverse for y in (0,
// largest_roughness).
template <class T>
TRACEFLOW_HD T roughness_of(T x) {
  return T(largest_roughness) * sigmoid(x);
}
template <class T>
TRACEFLOW_HD T roughness_derivative(T y) {
  return y * (T(1) - y / T(largest_roughness));
}
template <class T>
TRACEFLOW_HD T roughness_logit(T y) {
  return logit(y / T(largest_roughness));
}

}  // namespace traceflow
