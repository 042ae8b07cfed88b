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

// Photometric bundle adjustment (Delaunoy and Pollefeys 2014) of one body whose texture can be trusted: its
// poses at all times and what its nodes do, such that a point of its surface has the same detail, and the
// same normal prior in the surface's frame, in all views that show it. Surfels stay as they are at rest, and
// the pose of the first time stays.
//
// Gauss–Newton on residuals I_t(x) − I_s(x) of views that are 1, 3, 9 and 27 keys apart. Both are taken with
// the mean of their derivatives (efficient second-order minimisation, Malis 2004): with each view's own,
// noise in the photographs looks like what holds the body in the place where it is. On the CPU; the same
// bytes at any thread count.
class PhotometricAdjustment {
 public:
  // Keeps references to motion and nodes, which it changes. nodes: null where the body is rigid. options: how
  // pictures are drawn.
  PhotometricAdjustment(const Surfels& main, int32_t body, const raster::Options& options, Motion& motion,
                        Nodes* nodes);
  ~PhotometricAdjustment();
  PhotometricAdjustment(PhotometricAdjustment&&) noexcept;

  // Takes views of another size.
  void observe(FilmViews views);
  // Up to so many steps, as long as the cost falls.
  void solve(int steps);
  // The robust cost of the views, without what keeps the shape: a mean over compared points.
  double mean_texture_cost();

  // Whose derivatives the equations hold: the mean of both views', or each one's own, which are those of the
  // cost.
  enum class Derivatives { mean, own };
  // Where the body stands, in six numbers a time of the poses and a time of each node: ω (from the left,
  // radians) and the shift, in radii of the body or of the node.
  struct Equations {
    BandMatrix a;
    Eigen::VectorXd b;  // the derivative of the cost, negative
  };
  Equations equations(Derivatives derivatives);
  double cost();
  // Turns and shifts.
  void take(const Eigen::VectorXd& step);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace traceflow
