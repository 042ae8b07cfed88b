#pragma once

#include "viz/capture_picture/palette.h"

namespace traceflow::viz {

// From where a map is seen: world directions that point to the right and up in it.
struct MapAxes {
  Vec3<double> right, up;
};
// From above, the cameras' mean way of looking pointing up; and from the side, it pointing right. Up is what
// all cameras' x axes are level against; where they do not turn, what the cameras have up.
struct MapViews {
  MapAxes top, side;
};
MapViews map_views(const Capture& capture);

// Cameras as dots with the direction that they look in, and points, without perspective, size pixels. Marked
// cameras have a red ring, test ones a white square. The picture holds the cameras that are not marked as
// standing apart and nine tenths of the points that a quarter of the training views see; cameras outside
// stand at its border.
Tensor<uint8_t> camera_map(const Capture& capture, const Marks& marks, const MapAxes& axes,
                           const std::string& title, const Pixel& size);

}  // namespace traceflow::viz
