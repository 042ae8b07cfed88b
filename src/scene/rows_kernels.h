#pragma once

#include <cstdint>

#include "base/device.h"

namespace traceflow {

// One number of an edited tensor.
template <class T>
struct TakeRow {
  const int32_t* source;
  const uint8_t* zeroed;  // rows that become zero instead of copies; null: none
  uint32_t row;           // numbers per row
  const T* from;
  T* to;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const uint32_t at = static_cast<uint32_t>(i) / row, column = static_cast<uint32_t>(i) % row;
    const bool zero = zeroed != nullptr && zeroed[at] != 0;
    to[i] = zero ? T(0) : from[int64_t{source[at]} * row + column];
  }
};

}  // namespace traceflow
