#pragma once

#include <optional>

#include "capture/capture.h"

namespace traceflow {

// True positions of points on moving objects, at evenly spaced times from the capture's first (0) to its last
// (1).
struct MotionTruth {
  Tensor<float> points;    // T×N×3, the capture's own coordinates and units; T ≥ 2, N ≥ 1, finite
  Tensor<int32_t> object;  // N: the object that each point belongs to

  int64_t times() const { return points.dim(0); }
  int64_t count() const { return points.dim(1); }
};

// Reads truth/motion/points.npy and truth/motion/object.npy; returns nothing if both are missing. Throws
// InputError.
std::optional<MotionTruth> load_motion_truth(const Capture& capture);

}  // namespace traceflow
