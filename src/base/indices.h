#pragma once

#include <cstdint>
#include <string>

#include "base/error.h"
#include "base/tensor.h"

namespace traceflow {

// Throws InternalError unless the indices are strictly ascending within [0, limit), so that each thread can
// write its own entry. Indices on another device are not checked: the program computed them there.
inline void require_ascending(const Tensor<int32_t>& indices, int64_t limit) {
  if (indices.device() != Device::cpu) return;
  int64_t previous = -1;
  for (const int32_t index : indices.values()) {
    if (index > previous && index < limit) {
      previous = index;
      continue;
    }
    require(
        false, "indices rise within their range",
        std::to_string(index) + " after " + std::to_string(previous) + ", limit " + std::to_string(limit));
  }
}

}  // namespace traceflow
