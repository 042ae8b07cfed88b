#pragma once

#include <optional>
#include <vector>

#include "math/camera.h"
#include "math/types.h"

namespace traceflow {

// The bias of normal priors: one rotation in the camera's axes, since an estimator turns all normals of a
// surface alike.
class PriorBias {
 public:
  // The model's normal of a pixel and its prior, both in world axes. A pixel counts where both are at least
  // half a unit long.
  void add(const Camera<float>& camera, const Vec3<double>& normal, const Vec3<double>& prior);

  // The least-squares rotation from normals to priors (Kabsch), found in rounds: each over the pairs that the
  // round before left within 15 degrees. None from fewer than 50 such pairs.
  std::optional<Mat3<double>> rotation() const;

 private:
  struct Pair {
    Vec3<double> normal, prior;  // unit
  };
  std::vector<Pair> pairs_;
};

// The rotation, in world axes, that undoes a bias.
Mat3<float> inverse_of_bias(const Camera<float>& camera, const Mat3<double>& bias);

}  // namespace traceflow
