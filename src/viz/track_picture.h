#pragma once

#include <vector>

#include "viz/tracks.h"

namespace traceflow::viz {

// Where a frame's camera sees a point of the scene.
struct SeenPoint {
  Vec2<double> place{0};  // pixels; 0 unless in_front
  bool in_front = false;  // not nearer than the near plane
  bool visible = false;   // in front, in the image, and at most 1.02 times as far as the median depth
};

// Sees points in a frame, which must outlive it.
class PointViewer {
 public:
  explicit PointViewer(const Frame& frame);
  SeenPoint see(const Vec3<double>& point) const;

 private:
  const Camera<double> camera_;
  const double near_plane_;
  Tensor<float> fetched_;
  const Tensor<float>& depth_;
};

// A point's track in the image of a frame's camera.
struct SeenTrack {
  std::vector<Vec2<double>> place;  // pixels, from the present backwards
  std::vector<float> age;           // of each place, as in Tracks
  Vec3<float> colour{0};
};

// The tracks of the points that are visible in the frame, all projected by the frame's camera, so that static
// points have no track even if the camera moves. A track ends where it would pass behind the near plane.
std::vector<SeenTrack> seen_tracks(const Frame& frame, const Tracks& tracks);

// H×W×3: the frame's colours with the tracks as thin lines that fade with age, each in its point's colour of
// the rainbow, and a dot at each point's present position. The line width is proportional to the image size,
// but at least one pixel. Without tracks, returns the frame's colours. On the host.
Tensor<float> track_picture(const Frame& frame, const Tracks& tracks);

// Red over yellow, green and blue to violet, for 0 to 1.
Vec3<float> rainbow_colour(float hue);

}  // namespace traceflow::viz
