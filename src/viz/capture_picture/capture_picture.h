#pragma once

#include "capture/capture.h"

namespace traceflow::viz {

// An overview of a capture, H×1200×3. At the top are views at evenly spaced times with the outline of their
// masks, id and time; views that findings name are red. Below are all cameras, coloured by time, and the
// points, from above and from the side.
Tensor<uint8_t> capture_picture(const Capture& capture, const std::vector<Finding>& findings);

}  // namespace traceflow::viz
