#pragma once

#include <cstdint>
#include <vector>

#include "base/tensor.h"

namespace traceflow {

namespace cuda {

// Memory on the device that starts at a multiple of 16 bytes.
struct Range {
  std::byte* begin;
  int64_t bytes;
  int32_t first_block = 0;  // of the kernel's blocks, the first that works on it
};
// Fills all of them with zeros. Sets first_block.
TRACEFLOW_WITH_CUDA void fill_zero(std::vector<Range>& ranges);

}  // namespace cuda

// Tensors that are filled with zeros together: on the CUDA device by one kernel, where each would need a fill
// of its own.
class BatchedZeroFill {
 public:
  // The tensor must be neither resized nor released before fill(). One of the host is fill_zero at once.
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
