#include "track/true_poses.h"

#include <algorithm>
#include <glm/gtc/quaternion.hpp>
#include <vector>

#include "math/similarity_fit.h"
#include "scene/neighbours.h"

namespace traceflow {

namespace {

// Linear between two of the truth's times.
Vec3<double> point_at(const MotionTruth& truth, int64_t point, double time) {
  const double at = std::clamp(time, 0.0, 1.0) * static_cast<double>(truth.times() - 1);
  const auto before = std::min(static_cast<int64_t>(at), truth.times() - 2);
  const double share = at - static_cast<double>(before);
  return (1 - share) * load3<double>(&truth.points(before, point, 0)) +
         share * load3<double>(&truth.points(before + 1, point, 0));
}

std::vector<Vec3<double>> points_at(const MotionTruth& truth, const SceneNormalisation& normalisation,
                                    const std::vector<int64_t>& points, double time) {
  std::vector<Vec3<double>> positions;
  positions.reserve(points.size());
  for (const int64_t i : points) positions.push_back(normalisation.in_scene(point_at(truth, i, time)));
  return positions;
}

}  // namespace

void set_true_poses(const MotionTruth& truth, const SceneNormalisation& normalisation, const Surfels& surfels,
                    Motion& motion) {
  Tensor<float> first({truth.count(), 3});
  for (int64_t i = 0; i < truth.count(); ++i)
    store3(first.row(i), normalisation.in_scene(point_at(truth, i, motion.time[0])));
  const Tensor<int32_t> nearest = nearest_of(surfels.position, first);
  for (int64_t b = 0; b < motion.bodies(); ++b) {
    std::vector<int64_t> points;
    for (int64_t i = 0; i < truth.count(); ++i) {
      if (surfels.body[nearest[i]] == b) points.push_back(i);
    }
    if (points.empty()) continue;
    const std::vector<Vec3<double>> rest = points_at(truth, normalisation, points, motion.time[0]);
    const Vec3<double> centre = load3<double>(motion.centre.row(b));
    for (int64_t k = 0; k < motion.keys(); ++k) {
      const std::vector<Vec3<double>> now = points_at(truth, normalisation, points, motion.time[k]);
      const Mat3<double> rotation = fit_similarity(rest, now).rotation;
      Vec3<double> from(0), to(0);
      for (size_t i = 0; i < rest.size(); ++i) {
        from += rest[i] / static_cast<double>(rest.size());
        to += now[i] / static_cast<double>(rest.size());
      }
      const auto q = glm::quat_cast(rotation);
      const double wxyz[4] = {q.w, q.x, q.y, q.z};
      for (int c = 0; c < 4; ++c) motion.rotation(b, k, c) = static_cast<float>(wxyz[c]);
      store3(&motion.shift(b, k, 0), to - centre - rotation * (from - centre));
    }
  }
}

}  // namespace traceflow
