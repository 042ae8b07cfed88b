#pragma once

#include <cstdint>
#include <vector>

#include "base/tensor.h"

namespace traceflow {

namespace cuda {

// Memory on the device, aligned to 16 bytes.
struct Range {
  std::byte* begin;
  int64_t bytes;
  int32_t first_block = 0;  // the first of the kernel's blocks that works on it
};
// Fills all ranges with zeros. Sets first_block.
TRACEFLOW_WITH_CUDA void fill_zero(std::vector<Range>& ranges);

}  // namespace cuda

// Fills many tensors with zeros together: on the CUDA device by one kernel instead of one fill each.
class BatchedZeroFill {
 public:
  // The tensor must be neither resized nor released before fill(). A tensor on the host is filled at once.
  template <class T>
  void add(Tensor<T>& tensor) {
    if (tensor.device() == Device::cpu) {
      tensor.zero();
    } else if (!tensor.empty()) {
      ranges_.push_back(
          {reinterpret_cast<std::byte*>(tensor.data()), tensor.size() * static_cast<int64_t>(sizeof(T))});
    }
  }
  void fill() {
    if (!ranges_.empty()) cuda::fill_zero(ranges_);
    ranges_.clear();
  }

 private:
  std::vector<cuda::Range> ranges_;
};

}  // namespace traceflow
