#include "base/tensor.h"

namespace traceflow {

int64_t Shape::elements() const {
  if (rank_ == 0) return 0;
  int64_t product = 1;
  for (int i = 0; i < rank_; ++i) {
    require(dims_[static_cast<size_t>(i)] >= 0, "a dimension is not negative", to_string());
    require(!__builtin_mul_overflow(product, dims_[static_cast<size_t>(i)], &product),
            "a tensor's size fits 63 bits", to_string());
  }
  return product;
}

std::string Shape::to_string() const {
  std::string text;
  for (int i = 0; i < rank_; ++i) text += (i ? "x" : "") + std::to_string(dims_[static_cast<size_t>(i)]);
  return text.empty() ? "()" : text;
}

}  // namespace traceflow
