#include "viz/side_by_side.h"

#include <algorithm>
#include <string>

namespace traceflow::viz {

Tensor<uint8_t> side_by_side(const Tensor<uint8_t>& left, const Tensor<uint8_t>& right) {
  if (left.dim(0) != right.dim(0)) {
    throw InputError("pictures", "",
                     "heights of " + std::to_string(left.dim(0)) + " and " + std::to_string(right.dim(0)),
                     "one height, to stand side by side");
  }
  Tensor<uint8_t> both(Shape{left.dim(0), left.dim(1) + right.dim(1), 3});
  for (int64_t y = 0; y < both.dim(0); ++y) {
    std::copy(left.row(y), left.row(y) + left.row_size(), both.row(y));
    std::copy(right.row(y), right.row(y) + right.row_size(), both.row(y) + left.row_size());
  }
  return both;
}

}  // namespace traceflow::viz
