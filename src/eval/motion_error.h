#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "capture/motion_truth.h"

// How far the surfels follow the true motion of a capture's moving things. A point of a thing is carried by
// the opaque surfels that lie around it at time 0: it moves by the mean of what they move by, with weights
// that fall with their distance. Where it ends up is compared with where it truly is.
namespace traceflow::eval {

// One thing at one time. Lengths are the capture's own.
struct MotionMoment {
  double time = 0;                // in [0, 1]
  double moved = 0;               // median distance of the true points from where they are at time 0
  double missed = 0;              // median distance of the carried points from the true ones
  std::optional<double> share;    // missed, by what the thing moves in the mean (MotionFigures::moved)
  double rotation_error_deg = 0;  // between the rotations of the similarities that fit both motions best
  double scale = 1;               // of the one that fits the carried points
  double true_scale = 1;          // of the one that fits the true ones
};

// One thing in the mean over eight times that are evenly spread behind time 0, each figure as in
// MotionMoment. All are absent for a thing of which fewer than four points have surfels around them; the
// share is absent too for one that does not move.
struct MotionFigures {
  std::optional<double> moved, missed;
  std::optional<double> share;  // 1: not followed at all
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
  int64_t points = 0;           // that the capture knows
  int64_t followed_points = 0;  // that have surfels around them; all figures are of these
  MotionFigures figures;
  std::vector<MotionMoment> curve;  // all times, the first (0) included; empty where there are no figures
};

struct MotionReport {
  MotionFigures mean;  // of the things that have the figure, by their followed points
  std::vector<ObjectMotion> objects;
};

// Surfels that points can be carried by.
struct Carriers {
  Tensor<double> rest;  // M×3, at time 0, the capture's own coordinates
  // Positions (K×3) of the listed ones at a time. One that is not finite is taken to stay where it was.
  std::function<Tensor<double>(const std::vector<int32_t>& listed, float time)> at;
};

MotionReport motion_error(const MotionTruth& truth, const Carriers& surfels);

}  // namespace traceflow::eval
