#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "base/error.h"

namespace traceflow {

// Throws InternalError unless the indices rise strictly within [0, limit): what lets threads write one entry
// each.
inline void require_ascending(std::span<const int32_t> indices, int64_t limit) {
  int64_t previous = -1;
  for (const int32_t index : indices) {
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
