#pragma once

#include "viz/capture_picture/palette.h"

namespace traceflow::viz {

// The projection of a map: world directions of its right and up axes.
struct MapAxes {
  Vec3<double> right, up;
};
// Two views: from above with the cameras' mean viewing direction upwards, and from the side with it to the
// right. Up is perpendicular to all cameras' x axes or, if the cameras do not rotate enough, the cameras'
// mean up direction.
struct MapViews {
  MapAxes top, side;
};
MapViews map_views(const Capture& capture);

// Orthographic map of the cameras, as dots with viewing directions, and of the points; `size` in pixels.
// Marked cameras have a red ring, test cameras a white square. The map covers the cameras that are not marked
// as apart, and nine tenths of the points that a quarter of the training views see. Other cameras are drawn
// at the border.
Tensor<uint8_t> camera_map(const Capture& capture, const Marks& marks, const MapAxes& axes,
                           const std::string& title, const Pixel& size);

}  // namespace traceflow::viz
