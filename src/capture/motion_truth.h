#pragma once

#include <optional>

#include "capture/capture.h"

namespace traceflow {

// Where points of the moving things truly are at times that are evenly spread over the capture's, from its
// first (0) to its last (1).
struct MotionTruth {
  Tensor<float> points;    // T×N×3, the capture's own coordinates and units; T ≥ 2, N ≥ 1, finite
  Tensor<int32_t> object;  // N: which thing a point belongs to

  int64_t times() const { return points.dim(0); }
  int64_t count() const { return points.dim(1); }
};

// Reads truth/motion/points.npy and truth/motion/object.npy; nothing where the capture has neither. Throws
// InputError.
std::optional<MotionTruth> load_motion_truth(const Capture& capture);

}  // namespace traceflow
