#pragma once

#include <vector>

#include "capture/capture.h"
#include "render/render_options.h"
#include "scene/scene.h"
#include "train/new_surface.h"
#include "train/options.h"
#include "train/pose_solver.h"

namespace traceflow {

// Whether the colours of a body belong to its surface. A texture turns with the body; a mirror image stays
// behind, so that colour alone would take back a part of each turn. Gathered over the times followed.
struct ColourTrust {
  Tensor<double> taken_back;  // B, Σ −ω·d, radians²: d the last turn by normals and silhouettes, ω what
                              // colour alone would add to it
  Tensor<double> turned;  // B, Σ d·d

  bool holds(int64_t body) const;
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
  TrackWeights weights(const Motion& motion, const ColourTrust& trust) const;

  TrackOptions options_;
  RenderOptions render_;
  const Capture& capture_;
};

}  // namespace traceflow
