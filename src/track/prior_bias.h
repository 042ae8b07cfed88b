#pragma once

#include <optional>
#include <vector>

#include "math/camera.h"
#include "math/types.h"

namespace traceflow {

// The bias of normal priors: one rotation in camera axes, because an estimator rotates all normals of a
// surface alike.
class PriorBias {
 public:
  // Adds the model's normal of a pixel and its prior, both in world axes. The pair counts if both are at
  // least 0.5 long.
  void add(const Camera<float>& camera, const Vec3<double>& normal, const Vec3<double>& prior);

  // The least-squares rotation from normals to priors (Kabsch), in several rounds. Each round uses the pairs
  // within 15 degrees after the previous one. Returns nothing for fewer than 50 such pairs.
  std::optional<Mat3<double>> rotation() const;

 private:
  struct Pair {
    Vec3<double> normal, prior;  // unit
  };
  std::vector<Pair> pairs_;
};

// The rotation, in world axes, that corrects a bias.
Mat3<float> inverse_of_bias(const Camera<float>& camera, const Mat3<double>& bias);

}  // namespace traceflow
