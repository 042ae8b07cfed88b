#pragma once

#include <optional>
#include <vector>

#include "math/camera.h"
#include "math/types.h"

namespace traceflow {

// By which one rotation, in the camera's axes, normal priors are off together: an estimator turns all normals
// of a surface alike.
class PriorBias {
 public:
  // A pixel's normal as the model has it, and its prior, both in world axes. What is shorter than a half is
  // none.
  void add(const Camera<float>& camera, const Vec3<double>& normal, const Vec3<double>& prior);

  // The least-squares rotation from normals to priors over the pairs that it leaves within 15 degrees, in
  // rounds. None from fewer than 50 such pairs.
  std::optional<Mat3<double>> rotation() const;

 private:
  struct Pair {
    Vec3<double> normal, prior;  // unit
  };
  std::vector<Pair> pairs_;
};

// What takes priors, in world axes, back by a bias.
Mat3<float> without_bias(const Camera<float>& camera, const Mat3<double>& bias);

}  // namespace traceflow
