#include "track/prior_bias.h"

#include <array>
#include <cmath>

#include "math/similarity_fit.h"

namespace traceflow {

namespace {

// The rotation that best takes `from` to `to`, given Σ to · fromᵀ.
Mat3<double> rotation_of_moments(const Mat3<double>& moments) {
  std::array<Vec3<double>, 6> from, to;
  // The axes and their opposites, as points about the origin, have these moments.
  for (int axis = 0; axis < 3; ++axis) {
    const auto k = static_cast<size_t>(axis);
    Vec3<double> unit(0);
    unit[axis] = 1;
    from[2 * k] = unit;
    from[2 * k + 1] = -unit;
    to[2 * k] = moments[axis];
    to[2 * k + 1] = -moments[axis];
  }
  return fit_similarity(from, to).rotation;
}

}  // namespace

void PriorBias::add(const Camera<float>& camera, const Vec3<double>& normal, const Vec3<double>& prior) {
  constexpr double least_length2 = 0.25;
  if (dot(normal, normal) < least_length2 || dot(prior, prior) < least_length2) return;
  const Mat3<double> to_camera(camera.camera_from_world);
  pairs_.push_back({to_camera * normalize(normal), to_camera * normalize(prior)});
}

std::optional<Mat3<double>> PriorBias::rotation() const {
  constexpr double pull = 0.05;  // towards the previous round
  constexpr int rounds = 6;
  constexpr int64_t least_pairs = 50;
  constexpr double degree = 0.017453292519943295;
  Mat3<double> bias(1);
  for (int round = 0; round < rounds; ++round) {
    const double within = std::cos((round == 0 ? 25 : 15) * degree);
    Mat3<double> moments(0);
    int64_t count = 0;
    for (const auto& [normal, prior] : pairs_) {
      if (!(dot(bias * normal, prior) > within)) continue;
      moments += outerProduct(prior, normal);
      ++count;
    }
    if (count < least_pairs) return std::nullopt;
    bias = rotation_of_moments(moments + pull * static_cast<double>(count) * bias);
  }
  return bias;
}

Mat3<float> inverse_of_bias(const Camera<float>& camera, const Mat3<double>& bias) {
  const Mat3<double> to_camera(camera.camera_from_world);
  return Mat3<float>(transpose(to_camera) * transpose(bias) * to_camera);
}

}  // namespace traceflow
