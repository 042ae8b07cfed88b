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

// Whether what bodies look like tells how they turn; gathered over the times followed, for each of B bodies.
// Empty before. A texture turns with the body; a mirror image stays behind, so that the model's colours, and
// points that a program tracks, would take back a part of each turn. Where silhouettes and normals hardly
// tell a turn, as that of a ball, photographs and tracks are asked: what they show decides, and if it is a
// mirror image nothing is lost.
struct TextureTrust {
  Tensor<double> turned;                // B, Σ d·d, radians²: d the last turn, up to the key before
  Tensor<double> taken_back_by_colour;  // B, Σ −ω·d: ω what colour alone would add to the turn by normals
                                        // and silhouettes
  Tensor<double> taken_back_by_tracks;  // B, likewise
  Tensor<double> stiffness;  // B×3: Σ of the least and of the middle stiffness, and of how many times

  // Of B bodies of which nothing is known.
  static TextureTrust of(int64_t bodies);
  // Whether the model's colours, and the capture's tracks, belong to the surface.
  bool holds_colour(int64_t body) const { return holds(taken_back_by_colour, body); }
  bool holds_tracks(int64_t body) const { return holds(taken_back_by_tracks, body); }
  void add_stiffness(const std::vector<SymmetricEigen<3, double>>& now);
  // The turns of each body that photographs and tracks decide, by the mean stiffness and the axes now
  // (PoseSolver::turn_stiffness): none, those about the least stiff axis, or all. What looks the same however
  // it turns about two axes is a ball.
  LooseTurns loose_turns(const std::vector<SymmetricEigen<3, double>>& now) const;

 private:
  bool holds(const Tensor<double>& taken_back, int64_t body) const;
};

// Finds where rigid bodies are at a time of the film: Gauss–Newton on six numbers a body, from what does not
// depend on how their surface reflects: that they cover what the masks cover, and that their normals are
// those of the capture's priors; and from colour and tracked points where they are trusted. The priors'
// error, which estimators share over a picture, is turned away by one rotation a view, from what stands
// still. Works on the CPU on pictures of at most 160 pixels' width.
class Tracker {
 public:
  Tracker(const TrackOptions& options, const RenderOptions& render, const Capture& capture);

  // Puts key k where bodies that go on as in the three keys before would be, and the keys behind it there
  // too.
  static void predict(Motion& motion, int64_t key);
  // Predicts and finds the poses of a new key, and learns whether colour and tracks are to be trusted. A body
  // that is lost is looked for elsewhere (train/redetection.h). main, motion: on the CPU.
  void follow(const Surfels& main, Motion& motion, int64_t key, float extent, TextureTrust& trust) const;
  // Finds the poses of a key from where they are. At the first key, where one camera sees it, bodies stay as
  // far from that camera as the points are. nodes: null where bodies are rigid.
  void solve(const Surfels& main, const Nodes* nodes, Motion& motion, int64_t key, float extent,
             const PoseSteps& steps, const TextureTrust& trust) const;

  // Surfels for surface that comes into view at a key, at most `limit` (train/new_surface.h).
  Surfels new_surface(const Surfels& main, Motion& motion, int64_t key, float extent, float tint,
                      int64_t limit) const;

 private:
  TrackTarget target_of(const View& view) const;
  PoseSolver solver(const Surfels& main, const Nodes* nodes, Motion& motion, int64_t key, float extent) const;
  TrackWeights weights(const Motion& motion, const TextureTrust& trust, const LooseTurns& loose) const;
  // An earlier key, and what a view of it shows of the bodies.
  struct EarlierView {
    int64_t keys_back;
    size_t view;  // index of the training view
    BodySurface surface;
  };
  // Lets the solver compare the key's photograph with earlier ones, where photographs decide turns, and its
  // tracked points, where the capture has any.
  void compare_texture(PoseSolver& solver, const Surfels& main, const Motion& motion, int64_t key,
                       float extent, const LooseTurns& loose) const;
  void compare_photographs(PoseSolver& solver, const std::vector<EarlierView>& earlier, const Motion& motion,
                           int64_t key, const LooseTurns& loose) const;
  void compare_tracks(PoseSolver& solver, const std::vector<EarlierView>& earlier, const Motion& motion,
                      int64_t key) const;
  std::vector<size_t> views_at(const Motion& motion, int64_t key) const;
  // Of the pictures that are drawn of a view.
  Camera<float> drawn_camera(const View& view) const;

  TrackOptions options_;
  RenderOptions render_;
  const Capture& capture_;
};

}  // namespace traceflow
