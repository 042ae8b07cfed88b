#pragma once

#include <cmath>
#include <cstdint>

#include "base/device.h"

namespace traceflow {

// One surfel's signal of one iteration, added to its statistics.
struct AccumulateSignal {
  const float* signal;
  const uint8_t* touched;
  float *sum, *seen;

  TRACEFLOW_HD void operator()(int64_t i) const {
    if (touched[i] == 0 || !std::isfinite(signal[i])) return;
    sum[i] += signal[i];
    seen[i] += 1;
  }
};

}  // namespace traceflow
