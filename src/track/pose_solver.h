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

// Weights of the residuals: colours and silhouettes are in [0, 1], normals are unit vectors.
struct TrackWeights {
  float silhouette = 0, normal = 0;
  // For each body.
  std::vector<float> colour = {};
  std::vector<bool> tracks =
      {};  // per body: tracks determine the whole pose, or only loose rotations; empty: the latter
};

// How poses are solved.
struct PoseSteps {
  int count = 0;
  double blur = 0;          // of the first step, in pixels; each further step has 0.7 of it
  bool hold_depth = false;  // the distances of bodies are fixed if one camera sees them
};

// Gauss–Newton on the poses of all bodies at one key of a motion, six numbers per body, on the images of that
// key. On the CPU; the result has the same bytes at any thread count.
class PoseSolver {
 public:
  // Keeps references. nodes: null if bodies are rigid. options: of the rasteriser.
  PoseSolver(const Surfels& main, const Nodes* nodes, Motion& motion, int64_t key,
             const raster::Options& options, std::vector<TrackTarget> targets);

  // Rotates the priors of each target whose bias is not known, in camera axes, so that those of static
  // surfaces agree with the model.
  void turn_priors();
  const std::vector<TrackTarget>& targets() const { return targets_; }
  // The options of the rasteriser.
  const raster::Options& drawing() const { return options_; }
  // How strongly the weighted residuals constrain the rotations of each body, lowest first: the eigenvalues
  // of the normal equations of ω (radians, with the translation eliminated), over the pixels of a disk of the
  // body's size, and their axes. Empty without normal priors, because silhouettes alone constrain hardly
  // anything.
  std::vector<SymmetricEigen<3, double>> turn_stiffness(const TrackWeights& weights);
  // The points, in world coordinates, about which the weighted residuals decouple rotations and translations.
  // For a ball it is the centre, about which only texture shows rotations. At most a radius from the present
  // pivot.
  std::vector<Vec3<double>> turn_centres(const TrackWeights& weights);
  // Sets the loose rotations, which silhouettes, normals and the model's colours do not change. Of these,
  // photographs and tracked points change those in by_texture.
  void loosen(LooseTurns loose, LooseTurns by_texture) {
    loose_ = std::move(loose);
    by_texture_ = std::move(by_texture);
  }
  void compare(Alignment alignment) { alignments_.push_back(std::move(alignment)); }
  void compare(Reprojection reprojection) { reprojections_.push_back(std::move(reprojection)); }
  // Makes steps on blurred residuals. A step is accepted if the cost falls; otherwise shorter ones are tried.
  void solve(const TrackWeights& weights, const PoseSteps& steps);
  // The cost of the targets at the current poses.
  double cost(const TrackWeights& weights);
  // Call after others have changed the motion.
  void refresh() { pose(); }
  // The rotations ω of the bodies, in radians, that colour alone or tracked points alone would add. The
  // bodies stay where they are.
  std::vector<Vec3<double>> turns_by_colour();
  std::vector<Vec3<double>> turns_by_tracks();

 private:
  // The residuals of one view and their derivatives.
  struct Residuals {
    Tensor<float> value;     // n×7: silhouette, normal, colour
    Tensor<float> jacobian;  // n×P×7; unchanged if not requested
  };
  // The blocks of a body in the normal equations: of ω, of ω with the translation, and of the translation.
  struct PoseStiffness {
    Mat3<double> turn, both, shift;
  };
  std::vector<PoseStiffness> pose_stiffness(const TrackWeights& weights);
  void pose();
  // Set the weight of each pixel, which is constant while bodies move. Normals count everywhere in the masks,
  // or only in proportion to the bodies' coverage. Outside the bodies, the mask shows newly visible surface;
  // normals compared there would pull a body nearer until it covers them.
  enum class Over { masks, bodies };
  void weigh(const TrackWeights& weights);  // over the masks
  void weigh_normals(const TrackWeights& weights, Over over);
  void weigh_colour(const TrackWeights& weights);
  // at: index of a target. sigma: blur in pixels. Valid until the next call.
  const Residuals& residuals_of(size_t at, const TrackWeights& weights, double sigma, bool with_jacobian);
  // Adds the equations of the targets and returns their cost.
  double add_targets(const TrackWeights& weights, double sigma, NormalEquations& equations);
  // Removes the loose rotations from the equations.
  void hold_loose(NormalEquations& equations) const;
  // The cost of the photographs and the tracked points.
  double cost_of_texture(const TrackWeights& weights, NormalEquations* equations) const;
  double cost_of_tracks(const std::vector<bool>& decide, NormalEquations* equations) const;
  // The step for all targets, limited in size. cost: at the current poses.
  std::vector<double> step(const TrackWeights& weights, double sigma, bool depth_is_held, double& cost);
  // Solves equations in radians and scene units.
  std::vector<double> solved(NormalEquations equations, double damping, bool depth_is_held) const;
  // Makes some steps, restores the bodies, and returns their rotations by the steps.
  template <class F>
  std::vector<Vec3<double>> turns_of_steps(F&& next);
  // Adds to the matrix, with translations in radii, what keeps the distances from the camera fixed.
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
  LooseTurns loose_, by_texture_;                             // empty, or one per body
  std::vector<Alignment> alignments_;
  std::vector<Reprojection> reprojections_;
  raster::Output whole_;
  raster::SavedPtr blended_;
  Residuals residuals_;
  Tensor<float> scratch_;  // of the blur
};

}  // namespace traceflow
