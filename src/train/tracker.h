#pragma once

#include <vector>

#include "capture/capture.h"
#include "math/symmetric_eigen.h"
#include "render/render_options.h"
#include "scene/scene.h"
#include "train/new_surface.h"
#include "train/options.h"
#include "train/pose_solver.h"

namespace traceflow {

// Which colours tell how a body turns; gathered over the times followed, for each of B bodies. Empty before.
// A texture turns with the body; a mirror image stays behind, so that the model's colours would take back a
// part of each turn. Where silhouettes and normals hardly tell a turn, as that of a ball, photographs are
// compared: what they show decides, and if it is a mirror image nothing is lost.
struct ColourTrust {
  Tensor<double> taken_back;  // B, Σ −ω·d, radians²: d the last turn by normals and silhouettes, ω what
                              // colour alone would add to it
  Tensor<double> turned;     // B, Σ d·d
  Tensor<double> stiffness;  // B×3: Σ of the least and of the middle stiffness, and of how many times

  // Whether the model's colours belong to the surface.
  bool holds(int64_t body) const;
  void add_stiffness(const std::vector<SymmetricEigen<3, double>>& now);
  // The turns of each body that photographs decide, by the mean stiffness and the axes now
  // (PoseSolver::turn_stiffness): none, those about the least stiff axis, or all. What looks the same however
  // it turns about two axes is a ball.
  LooseTurns loose_turns(const std::vector<SymmetricEigen<3, double>>& now) const;
};

// Finds where rigid bodies are at a time of the film: Gauss–Newton on six numbers a body, from what does not
// depend on how their surface reflects: that they cover what the masks cover, and that their normals are
// those of the capture's priors; and from colour where it is trusted. The priors' error, which estimators
// share over a picture, is turned away by one rotation a view, from what stands still. Works on the CPU on
// pictures of at most 160 pixels' width.
class Tracker {
 public:
  Tracker(const TrackOptions& options, const RenderOptions& render, const Capture& capture);

  // Puts key k where bodies that go on as in the three keys before would be, and the keys behind it there
  // too.
  static void predict(Motion& motion, int64_t key);
  // Predicts and finds the poses of a new key, and learns whether colour is to be trusted. main, motion: on
  // the CPU.
  void follow(const Surfels& main, Motion& motion, int64_t key, float extent, ColourTrust& trust) const;
  // Finds the poses of a key from where they are. At the first key, where one camera sees it, bodies stay as
  // far from that camera as the points are. nodes: null where bodies are rigid.
  void solve(const Surfels& main, const Nodes* nodes, Motion& motion, int64_t key, float extent,
             const PoseSteps& steps, const ColourTrust& trust) const;

  // Surfels for surface that comes into view at a key, at most `limit` (train/new_surface.h).
  Surfels new_surface(const Surfels& main, Motion& motion, int64_t key, float extent, float tint,
                      int64_t limit) const;

 private:
  TrackTarget target_of(const View& view) const;
  PoseSolver solver(const Surfels& main, const Nodes* nodes, Motion& motion, int64_t key, float extent) const;
  TrackWeights weights(const Motion& motion, const ColourTrust& trust, const LooseTurns& loose) const;
  // Lets the solver compare the key's photograph with earlier ones, where photographs decide turns.
  void compare_photographs(PoseSolver& solver, const Surfels& main, const Motion& motion, int64_t key,
                           float extent, const LooseTurns& loose) const;
  // Of the pictures that are drawn of a view.
  Camera<float> drawn_camera(const View& view) const;

  TrackOptions options_;
  RenderOptions render_;
  const Capture& capture_;
};

}  // namespace traceflow
