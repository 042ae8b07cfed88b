#pragma once

#include "base/tensor.h"

namespace traceflow {

// The k nearest other points of each of N points, nearest first. If there are fewer than k others, the rest
// repeat the farthest; a lone point has none (index -1, distance 0).
struct Neighbours {
  Tensor<int32_t> index;    // N×k
  Tensor<float> distance2;  // N×k, squared

  // A copy on a device.
  Neighbours on(Device device) const { return {index.on(device), distance2.on(device)}; }
};
Neighbours nearest_neighbours(const Tensor<float>& points, int k);
// Every stride-th of the k·stride nearest others: k of them, but from a larger neighbourhood.
Neighbours spread_neighbours(const Tensor<float>& points, int k, int stride);
// For each of M queries (M×3) the nearest of N ≥ 1 points.
Tensor<int32_t> nearest_of(const Tensor<float>& points, const Tensor<float>& queries);
// For each of M queries (M×3) the k nearest of N points, nearest first. With fewer than k points the
// remaining entries have index -1 and distance 0.
Neighbours nearest_of(const Tensor<float>& points, const Tensor<float>& queries, int k);

}  // namespace traceflow
