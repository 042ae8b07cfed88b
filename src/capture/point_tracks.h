#pragma once

#include <vector>

#include "base/tensor.h"

namespace traceflow {

struct ViewSource;

// Where N points of the scene are seen, as a program that tracks points says. V: the training views, in the
// capture's order.
struct PointTracks {
  Tensor<float> direction;  // V×N×2, X/Z and Y/Z in the view's camera
  Tensor<uint8_t> seen;     // V×N

  bool empty() const { return seen.empty(); }
  int64_t count() const { return empty() ? 0 : seen.dim(1); }
};

// The row of tracks.npy that belongs to a training view, and how that view was taken; −1: none.
struct TrackRow {
  int64_t row = -1;
  const ViewSource* source = nullptr;
};

// Of tracks.npy (docs/captures.md), one row a training view. Points outside of the photograph are not seen,
// nor are those whose place is not finite.
PointTracks tracks_of_rows(const Tensor<float>& stored, const std::vector<TrackRow>& rows);

}  // namespace traceflow
