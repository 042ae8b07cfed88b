#pragma once

#include <vector>

#include "base/tensor.h"

namespace traceflow {

struct ViewSource;

// Image positions of N scene points, from an external point tracker. V: the training views, in the capture's
// order.
struct PointTracks {
  Tensor<float> direction;  // V×N×2, X/Z and Y/Z in the view's camera
  Tensor<uint8_t> seen;     // V×N

  bool empty() const { return seen.empty(); }
  int64_t count() const { return empty() ? 0 : seen.dim(1); }
};

// The row of tracks.npy that belongs to a training view (−1: none), and the camera data of that view.
struct TrackRow {
  int64_t row = -1;
  const ViewSource* source = nullptr;
};

// Converts tracks.npy (docs/captures.md); one row per training view. A point outside the photograph, or
// without a finite position, is not seen.
PointTracks tracks_of_rows(const Tensor<float>& stored, const std::vector<TrackRow>& rows);

}  // namespace traceflow
