#pragma once

#include <cstdint>
#include <Eigen/Core>
#include <memory>
#include <vector>

#include "ops/raster/raster.h"
#include "scene/motion.h"
#include "scene/nodes.h"
#include "scene/surfels.h"
#include "track/band_matrix.h"
#include "track/body_in_film.h"

namespace traceflow {

// Photometric bundle adjustment (Delaunoy and Pollefeys 2014) of one body with trusted texture. It solves the
// poses at all keys and the motion of the nodes, so that a point of the surface has the same detail, and the
// same normal prior in the surface's frame, in all views that show it. The surfels at rest and the pose of
// the first key are fixed.
//
// Gauss–Newton on residuals I_t(x) − I_s(x) of views that are 1, 3, 9 and 27 keys apart. Both images use the
// mean of their derivatives (efficient second-order minimisation, Malis 2004). With the derivatives of each
// view, noise in the photographs would hold the body in place. On the CPU; the result has the same bytes at
// any thread count.
class PhotometricAdjustment {
 public:
  // Keeps references to motion and nodes, and changes them. nodes: null if the body is rigid. options: of the
  // rasteriser.
  PhotometricAdjustment(const Surfels& main, int32_t body, const raster::Options& options, Motion& motion,
                        Nodes* nodes);
  ~PhotometricAdjustment();
  PhotometricAdjustment(PhotometricAdjustment&&) noexcept;

  // Replaces the views by those of another size.
  void observe(FilmViews views);
  // Makes up to `steps` steps, as long as the cost falls.
  void solve(int steps);
  // The robust cost of the views without regularisation, as a mean over compared points.
  double mean_texture_cost();

  // The derivatives in the equations: the mean of both views, or those of each view, which are the exact ones
  // of the cost.
  enum class Derivatives { mean, own };
  // The equations at the current state. Each pose and each node at each of its times has six numbers: ω (from
  // the left, radians) and the translation, in radii of the body or of the node.
  struct Equations {
    BandMatrix a;
    Eigen::VectorXd b;  // the negative derivative of the cost
  };
  Equations equations(Derivatives derivatives);
  double cost();
  // Applies a step to rotations and translations.
  void take(const Eigen::VectorXd& step);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace traceflow
