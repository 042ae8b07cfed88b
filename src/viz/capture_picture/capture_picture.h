#pragma once

#include "capture/capture.h"

namespace traceflow::viz {

// A capture at a glance, H×1200×3: views spread over time with the outline of their masks, id and time, those
// that findings name in red; below them all cameras, coloured by time, and the points, from above and from
// the side.
Tensor<uint8_t> capture_picture(const Capture& capture, const std::vector<Finding>& findings);

}  // namespace traceflow::viz
