#pragma once

#include <vector>

#include "scene/surfels.h"

namespace traceflow {

// How a set of surfels becomes another: row i of the new set is a copy of row source[i] of the old one. A
// fresh row is a new surfel, whose optimiser state and statistics start at zero.
struct RowEdit {
  std::vector<int32_t> source;
  std::vector<uint8_t> fresh;

  int64_t count() const { return static_cast<int64_t>(source.size()); }
  void keep(int64_t row) {
    source.push_back(static_cast<int32_t>(row));
    fresh.push_back(0);
  }
  void add(int64_t row) {
    source.push_back(static_cast<int32_t>(row));
    fresh.push_back(1);
  }
};

// An edit on the device of the tensors that it is applied to.
struct PlacedEdit {
  Tensor<int32_t> source;
  Tensor<uint8_t> fresh;

  PlacedEdit(const RowEdit& edit, Device device)
      : source(tensor_of(edit.source).on(device)), fresh(tensor_of(edit.fresh).on(device)) {}
  int64_t count() const { return source.size(); }
};

// Applies an edit to a tensor whose first index is the surfel. zero_fresh: fresh rows become zero instead of
// copies.
Tensor<float> edited_rows(const Tensor<float>& tensor, const PlacedEdit& edit, bool zero_fresh);
Surfels edited_rows(const Surfels& surfels, const PlacedEdit& edit);
inline void edit_rows(Surfels& surfels, const RowEdit& edit) {
  surfels = edited_rows(surfels, PlacedEdit(edit, surfels.device()));
}
// Appends the rows of another set with the same groups and degree. On the CPU.
void append_rows(Surfels& surfels, const Surfels& more);

}  // namespace traceflow
