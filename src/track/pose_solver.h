#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "math/camera.h"
#include "math/symmetric_eigen.h"
#include "ops/motion/motion.h"
#include "ops/raster/raster.h"
#include "scene/nodes.h"
#include "scene/surfels.h"
#include "track/photo_alignment.h"
#include "track/reprojection.h"

namespace traceflow {

// A view at the size for tracking.
struct TrackTarget {
  Camera<float> camera;
  bool is_shrunk = false;
  Tensor<float> colour;            // H×W×3
  Tensor<float> coverage;          // H×W
  Tensor<uint8_t> mask;            // H×W
  Tensor<float> normal_prior;      // H×W×3 or empty
  bool prior_is_unbiased = false;  // in the mask
};

// Weights of what is compared: residuals are in [0, 1], normals unit.
struct TrackWeights {
  float silhouette = 0, normal = 0;
  // Of each body.
  std::vector<float> colour = {};
  std::vector<bool> tracks =
      {};  // whether tracked points decide its pose, or its loose turns alone; empty: those
};

// How poses are solved.
struct PoseSteps {
  int count = 0;
  double blur = 0;          // of the first step, pixels; 0.7 of it at each step that follows
  bool hold_depth = false;  // bodies stay as far away as they are, where one camera sees them
};

// Gauss–Newton on the poses of all bodies at one key of a motion, six numbers a body, on pictures of that
// time. On the CPU; the same bytes at any thread count.
class PoseSolver {
 public:
  // Keeps references. nodes: null where bodies are rigid. options: how pictures are drawn.
  PoseSolver(const Surfels& main, const Nodes* nodes, Motion& motion, int64_t key,
             const raster::Options& options, std::vector<TrackTarget> targets);

  // Turns each target's priors whose bias is not known, in the camera's axes, so that those of what stands
  // still agree with the model.
  void turn_priors();
  const std::vector<TrackTarget>& targets() const { return targets_; }
  // How pictures are drawn.
  const raster::Options& drawing() const { return options_; }
  // How stiffly what is weighed holds each body's turns where it stands, least first: eigenvalues of the
  // normal equations of ω (radians, its shift free), over the pixels of a disk of its size, and their axes.
  // Empty without normal priors: silhouettes alone hold hardly anything.
  std::vector<SymmetricEigen<3, double>> turn_stiffness(const TrackWeights& weights);
  // The points, in world, about which what is weighed tells turns and shifts apart: the centre of a ball,
  // about which nothing but its texture tells a turn. At most a radius from where a body turns now.
  std::vector<Vec3<double>> turn_centres(const TrackWeights& weights);
  // Turns that silhouettes, normals and the model's colours do not change: only photographs that are compared
  // and tracked points do, by_texture of them.
  void loosen(LooseTurns loose, LooseTurns by_texture) {
    loose_ = std::move(loose);
    by_texture_ = std::move(by_texture);
  }
  void compare(Alignment alignment) { alignments_.push_back(std::move(alignment)); }
  void compare(Reprojection reprojection) { reprojections_.push_back(std::move(reprojection)); }
  // Steps on blurred residuals; each is taken where the cost falls, else shorter ones are tried.
  void solve(const TrackWeights& weights, const PoseSteps& steps);
  // What the targets cost where bodies stand.
  double cost(const TrackWeights& weights);
  // After the motion has been changed by others.
  void refresh() { pose(); }
  // How colour alone, or tracked points alone, would turn the bodies from where they are, which stay there: ω
  // of each, radians.
  std::vector<Vec3<double>> turns_by_colour();
  std::vector<Vec3<double>> turns_by_tracks();

 private:
  // One view's residuals and how they change.
  struct Residuals {
    Tensor<float> value;     // n×7: silhouette, normal, colour
    Tensor<float> jacobian;  // n×P×7; as it was where not asked for
  };
  // The blocks of a body in the normal equations: of ω, of ω by the shift, and of the shift.
  struct PoseStiffness {
    Mat3<double> turn, both, shift;
  };
  std::vector<PoseStiffness> pose_stiffness(const TrackWeights& weights);
  void pose();
  // Set each pixel's weights, which then stand while bodies move. Normals count in the masks, or only as far
  // as bodies cover them: what a mask shows beyond them is surface that has come into view, and normals that
  // are compared there pull a body nearer until it covers it.
  enum class Over { masks, bodies };
  void weigh(const TrackWeights& weights);  // over the masks
  void weigh_normals(const TrackWeights& weights, Over over);
  void weigh_colour(const TrackWeights& weights);
  // at: of a target. sigma: of the blur, pixels. Until the next call.
  const Residuals& look(size_t at, const TrackWeights& weights, double sigma, bool with_jacobian);
  // Adds what the targets ask for; returns the cost.
  double add_targets(const TrackWeights& weights, double sigma, NormalEquations& equations);
  // Takes the loose turns out of the equations.
  void hold_loose(NormalEquations& equations) const;
  // The cost of the photographs and the tracked points that are compared.
  double cost_of_texture(const TrackWeights& weights, NormalEquations* equations) const;
  double cost_of_tracks(const std::vector<bool>& decide, NormalEquations* equations) const;
  // The step that a view of all targets asks for, limited; the cost where they stand.
  std::vector<double> step(const TrackWeights& weights, double sigma, bool depth_is_held, double& cost);
  // Of equations in radians and world units.
  std::vector<double> solved(NormalEquations equations, double damping, bool depth_is_held) const;
  // Takes some steps, and returns how they have turned the bodies, which are put back.
  template <class F>
  std::vector<Vec3<double>> turns_of_steps(F&& next);
  // Adds to the normal equations' matrix, of shifts in radii, what keeps bodies as far from the camera.
  void hold_depth(std::vector<double>& matrix) const;
  void take(const std::vector<double>& step);

  const Surfels& main_;
  Motion& motion_;
  int64_t key_;
  raster::Options options_;
  std::vector<TrackTarget> targets_;
  size_t params_;
  std::vector<double> radius_;
  PosedSurfels still_, posed_;
  motion::SavedPtr saved_;
  Tensor<float> pivot_;
  std::vector<Tensor<float>> normal_weight_, colour_weight_;  // of each target, H×W
  LooseTurns loose_, by_texture_;                             // empty, or of each body
  std::vector<Alignment> alignments_;
  std::vector<Reprojection> reprojections_;
  raster::Output whole_;
  raster::SavedPtr blended_;
  Residuals residuals_;
  Tensor<float> scratch_;  // of the blur
};

}  // namespace traceflow
