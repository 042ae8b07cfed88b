#pragma once

#include "viz/capture_picture/palette.h"

namespace traceflow::viz {

// Up to 24 views in time order, in six columns: up to eight marked views, and evenly spaced others.
Tensor<uint8_t> view_tiles(const Capture& capture, const Marks& marks);

}  // namespace traceflow::viz
