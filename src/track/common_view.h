#pragma once

#include <vector>

#include "base/random.h"
#include "base/tensor.h"
#include "capture/capture.h"

namespace traceflow {

// `count` random points for a capture without points. Each lies in front of a random camera, at a depth from
// 0.2 to 10 times the capture's extent, distributed log-uniformly. Points are kept if at least half as many
// views see them as see the best point. Returns fewer than `count` if such points are rare.
Tensor<float> points_in_common_view(const std::vector<View>& views, float extent, int64_t count,
                                    Random& random);

}  // namespace traceflow
