#pragma once

#include <vector>

#include "viz/cameras/camera_path.h"

namespace traceflow::viz {

// A smooth motion through a path's keyframes: at each, speed and turning go over continuously. Where two
// keyframes in a row are equal, nothing moves between them, and the motion around comes to rest. Going
// through the keyframes backwards gives the same motion backwards.
//   position: a centripetal Catmull-Rom curve, travelled by a monotone function of time
//   rotation: quaternion Bézier segments, the shortest way
//   fov, time: monotone between keyframes
class PathCurve {
 public:
  // The path has a keyframe, and no seconds that count are 0.
  explicit PathCurve(const CameraPath& path);

  // Seconds from the first keyframe to the end.
  double duration() const { return starts_.back(); }
  Pose at(double seconds) const;

 private:
  // A unit quaternion, (w, x, y, z).
  using Quaternion = Vec4<double>;

  void turn(const std::vector<double>& durations);

  bool closed_;
  std::vector<Keyframe> keys_;          // where the path is closed, the first again at the end
  std::vector<double> starts_;          // of each key, seconds
  std::vector<double> knots_;           // of each key, along the curve
  std::vector<Vec3<double>> tangents_;  // dposition/dknot
  std::vector<double> knot_slopes_, fov_slopes_, time_slopes_;  // d/dsecond
  std::vector<Quaternion> rotations_;
  std::vector<Vec3<double>> turns_;  // half the angular velocity in the camera's axes, radians a second
};

}  // namespace traceflow::viz
