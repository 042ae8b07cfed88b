#pragma once

#include <vector>

#include "base/random.h"
#include "base/tensor.h"
#include "capture/capture.h"

namespace traceflow {

// `count` random points for a capture that has none: before some camera, at depths from 0.2 to 10 times the
// capture's extent, each as likely at twice the depth as between; of these the ones that at least half as
// many views see as the best seen one. Fewer than `count` where such points are rare.
Tensor<float> points_in_common_view(const std::vector<View>& views, float extent, int64_t count,
                                    Random& random);

}  // namespace traceflow
