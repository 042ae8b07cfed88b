#pragma once

#include "viz/capture_picture/palette.h"

namespace traceflow::viz {

// Up to 24 views in the order of time, in six columns: those that are marked, up to eight of them, and others
// spread evenly.
Tensor<uint8_t> view_tiles(const Capture& capture, const Marks& marks);

}  // namespace traceflow::viz
