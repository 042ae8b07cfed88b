#pragma once

#include <vector>

#include "scene/surfels.h"

namespace traceflow {

// How a set of surfels becomes another: row i of the new set is a copy of row source[i] of the old one; a
// fresh row is a new surfel, whose optimiser and statistics start from zero.
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

// Applies an edit to a tensor whose first index counts surfels. zero_fresh: fresh rows become zero instead of
// copies.
Tensor<float> edited_rows(const Tensor<float>& tensor, const RowEdit& edit, bool zero_fresh);
void edit_rows(Surfels& surfels, const RowEdit& edit);
// Adds the rows of another set, which has the same groups and degree, after those of the first.
void append_rows(Surfels& surfels, const Surfels& more);

}  // namespace traceflow
