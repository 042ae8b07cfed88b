#pragma once

#include <vector>

#include "viz/tracks.h"

namespace traceflow::viz {

// A point's path as the camera of a frame sees it.
struct SeenTrack {
  std::vector<Vec2<double>> place;  // pixels, from the present backwards
  std::vector<float> age;           // of each place, as Tracks has it
  Vec3<float> colour{0};
};

// The paths of the points that the frame shows, all by its own camera, so that what stands still has no path
// however the camera moves. A point that is outside the picture now, or that lies farther than the frame's
// median depth by more than a fiftieth, is left out. A path ends where it comes from behind the near plane.
std::vector<SeenTrack> seen_tracks(const Frame& frame, const Tracks& tracks);

// H×W×3: the frame's colours, over them the paths as thin lines that fade with age, each in its point's
// colour of the rainbow, and a dot where the point is now. A picture of any size has lines of the same share
// of it, though none thinner than a pixel. Without paths the frame's colours. On the host.
Tensor<float> track_picture(const Frame& frame, const Tracks& tracks);

// Red over yellow, green and blue to violet, for 0 to 1.
Vec3<float> rainbow_colour(float hue);

}  // namespace traceflow::viz
