#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "capture/motion_truth.h"

// Measures how well the surfels follow the true motion of a capture's moving objects. The opaque surfels
// around a point at time 0 carry it: it moves by the weighted mean of their displacements, with weights that
// fall with distance. The result is compared with the true position.
namespace traceflow::eval {

// One object at one time. Lengths are in the capture's units.
struct MotionMoment {
  double time = 0;                // in [0, 1]
  double moved = 0;               // median distance of the true points from their positions at time 0
  double missed = 0;              // median distance of the carried points from the true ones
  std::optional<double> share;    // missed, over the object's mean motion (MotionFigures::moved)
  double rotation_error_deg = 0;  // between the rotations of the best fits (similarity) to both motions
  double scale = 1;               // of the transform that fits the carried points
  double true_scale = 1;          // of the transform that fits the true points
};

// One object: means over eight evenly spaced times after time 0, each metric as in MotionMoment. All are
// absent if fewer than four points have surfels around them. The share is also absent for an object that does
// not move.
struct MotionFigures {
  std::optional<double> moved, missed;
  std::optional<double> share;  // 1: as bad as no motion at all
  std::optional<double> rotation_error_deg, scale, true_scale;

  template <class Self, class F>
  static void visit(Self& self, F&& f) {
    f("moved", self.moved);
    f("missed", self.missed);
    f("share", self.share);
    f("rotation_error_deg", self.rotation_error_deg);
    f("scale", self.scale);
    f("true_scale", self.true_scale);
  }
};

struct ObjectMotion {
  int32_t object = 0;
  int64_t points = 0;           // in the capture
  int64_t followed_points = 0;  // with surfels around them; all metrics are over these
  MotionFigures figures;
  std::vector<MotionMoment> curve;  // all times, including the first (0); empty if there are no metrics
};

struct MotionReport {
  MotionFigures mean;  // over the objects that have the metric, weighted by their followed points
  std::vector<ObjectMotion> objects;
};

// Surfels that carry points.
struct Carriers {
  Tensor<double> rest;  // M×3, at time 0, the capture's coordinates
  // Positions (K×3) of the listed surfels at a time. One that is not finite counts as not moved.
  std::function<Tensor<double>(const std::vector<int32_t>& listed, float time)> at;
};

MotionReport motion_error(const MotionTruth& truth, const Carriers& surfels);

}  // namespace traceflow::eval
