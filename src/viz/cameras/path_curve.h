#pragma once

#include <glm/gtc/quaternion.hpp>
#include <vector>

#include "viz/cameras/camera_path.h"

namespace traceflow::viz {

// A smooth motion through a path's keyframes, with continuous linear and angular velocity. Between two equal
// successive keyframes nothing moves, and the motion around them comes to rest. The reversed list of
// keyframes gives the reversed motion.
//   position: a centripetal Catmull-Rom curve, parametrised by a monotone function of time
//   rotation: quaternion Bézier segments, the shortest way
//   fov, time: monotone between keyframes
class PathCurve {
 public:
  // The path must have a keyframe, and the seconds of its segments must not be 0.
  explicit PathCurve(const CameraPath& path);

  // Seconds from the first keyframe to the end.
  double duration() const { return starts_.back(); }
  Pose at(double seconds) const;

 private:
  void turn(const std::vector<double>& durations);

  bool closed_;
  std::vector<Keyframe> keys_;          // for a closed path, the first is repeated at the end
  std::vector<double> starts_;          // time of each key, seconds
  std::vector<double> knots_;           // curve parameter of each key
  std::vector<Vec3<double>> tangents_;  // dposition/dknot
  std::vector<double> knot_slopes_, fov_slopes_, time_slopes_;  // d/dsecond
  std::vector<glm::dquat> rotations_;
  std::vector<Vec3<double>> turns_;  // half the angular velocity in the camera's axes, radians per second
};

}  // namespace traceflow::viz
