#include "viz/cameras/path_curve.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/ext/quaternion_exponential.hpp>

#include "base/error.h"

namespace traceflow::viz {

namespace {

using V = Vec3<double>;
using Q = glm::dquat;

// Half the rotation vector from a to b in the axes of a, the shorter way.
V half_turn(const Q& a, const Q& b) {
  const Q d = glm::conjugate(a) * b, turn = glm::log(d.w < 0 ? -d : d);
  return {turn.x, turn.y, turn.z};
}
Q from_half_turn(const V& v) { return glm::exp(Q(0, v)); }

// The quaternion Bézier curve by de Casteljau's algorithm.
Q bezier(std::array<Q, 4> q, double u) {
  for (size_t level = 3; level > 0; --level) {
    for (size_t i = 0; i < level; ++i) q.at(i) = glm::slerp(q.at(i), q.at(i + 1), u);
  }
  return glm::normalize(q[0]);
}

// The cubic from a to b with these slopes at its ends, over an interval of length h.
template <class T>
T hermite(const T& a, const T& slope_a, const T& b, const T& slope_b, double h, double u) {
  const double v = 1 - u;
  return a * (v * v * (1 + 2 * u)) + b * (u * u * (1 + 2 * v)) + slope_a * (h * u * v * v) -
         slope_b * (h * u * u * v);
}

// Slopes that keep the cubics monotone (Fritsch, Butland), for values at keys `steps` apart: the harmonic
// mean of the secants, or 0 at an extremum. For a closed path, the first and the last key are the same.
std::vector<double> monotone_slopes(const std::vector<double>& values, const std::vector<double>& steps,
                                    bool round) {
  const size_t segments = steps.size();
  std::vector<double> secants(segments), slopes(segments + 1, 0);
  for (size_t i = 0; i < segments; ++i) secants[i] = (values[i + 1] - values[i]) / steps[i];
  const auto slope = [&](size_t before, size_t after) {
    const double a = secants[before], b = secants[after];
    if (a * b <= 0) return 0.0;
    const double h = steps[before], k = steps[after];
    return 3 * (h + k) / ((2 * k + h) / a + (k + 2 * h) / b);
  };
  if (segments == 0) return slopes;
  for (size_t i = 1; i < segments; ++i) slopes[i] = slope(i - 1, i);
  slopes.front() = round ? slope(segments - 1, 0) : secants.front();
  slopes.back() = round ? slopes.front() : secants.back();
  return slopes;
}

// The non-uniform mean of two slopes at a key, which weights the shorter side more; 0 if either side is at
// rest.
V joined(const V& before, double h, const V& after, double k) {
  const double a = length(before), b = length(after);
  if (!(a > 0 && b > 0)) return V(0);
  return (before * k + after * h) / (h + k);
}

}  // namespace

PathCurve::PathCurve(const CameraPath& path) : closed_(path.closed), keys_(path.keyframes) {
  require(!keys_.empty(), "a path has a keyframe");
  if (closed_) keys_.push_back(keys_.front());
  const size_t segments = keys_.size() - 1;
  std::vector<double> durations(segments), steps(segments), fovs, times;
  starts_ = knots_ = {0};
  for (size_t i = 0; i < segments; ++i) {
    durations[i] = keys_[i].seconds;
    steps[i] = std::sqrt(length(keys_[i + 1].position - keys_[i].position));
    starts_.push_back(starts_.back() + durations[i]);
    knots_.push_back(knots_.back() + steps[i]);
  }
  for (const Keyframe& key : keys_) {
    fovs.push_back(key.fov_y);
    times.push_back(key.time);
    rotations_.push_back(glm::quat_cast(key.world_from_camera));
  }
  knot_slopes_ = monotone_slopes(knots_, durations, closed_);
  fov_slopes_ = monotone_slopes(fovs, durations, closed_);
  time_slopes_ = monotone_slopes(times, durations, closed_);

  tangents_.assign(keys_.size(), V(0));
  const auto secant = [&](size_t i) {
    return steps[i] > 0 ? (keys_[i + 1].position - keys_[i].position) / steps[i] : V(0);
  };
  for (size_t i = 1; i < segments; ++i)
    tangents_[i] = joined(secant(i - 1), steps[i - 1], secant(i), steps[i]);
  if (segments > 0) {
    tangents_.front() = closed_ ? joined(secant(segments - 1), steps.back(), secant(0), steps[0]) : secant(0);
    tangents_.back() = closed_ ? tangents_.front() : secant(segments - 1);
  }
  turn(durations);
}

void PathCurve::turn(const std::vector<double>& durations) {
  const size_t segments = durations.size();
  turns_.assign(keys_.size(), V(0));
  // A rotation's axis is the same in the axes of both of its keys.
  const auto rate = [&](size_t i) { return half_turn(rotations_[i], rotations_[i + 1]) / durations[i]; };
  // As for monotone values: at most three times the speed of the slower side.
  const auto joint = [&](size_t before, size_t after) {
    const V a = rate(before), b = rate(after);
    const V mean = joined(a, durations[before], b, durations[after]);
    const double most = 3 * std::min(length(a), length(b)), now = length(mean);
    return now > most ? mean * (most / now) : mean;
  };
  for (size_t i = 1; i < segments; ++i) turns_[i] = joint(i - 1, i);
  if (segments == 0) return;
  turns_.front() = closed_ ? joint(segments - 1, 0) : rate(0);
  turns_.back() = closed_ ? turns_.front() : rate(segments - 1);
}

Pose PathCurve::at(double seconds) const {
  if (keys_.size() == 1) return keys_.front();
  const double t = std::clamp(seconds, 0.0, duration());
  const auto after = std::upper_bound(starts_.begin(), starts_.end() - 1, t);
  const auto i = static_cast<size_t>(std::max<std::ptrdiff_t>(1, after - starts_.begin())) - 1;
  const double h = starts_[i + 1] - starts_[i], u = std::clamp((t - starts_[i]) / h, 0.0, 1.0);

  Pose pose = keys_[i];
  pose.fov_y = hermite(keys_[i].fov_y, fov_slopes_[i], keys_[i + 1].fov_y, fov_slopes_[i + 1], h, u);
  pose.time = hermite(keys_[i].time, time_slopes_[i], keys_[i + 1].time, time_slopes_[i + 1], h, u);
  if (const double step = knots_[i + 1] - knots_[i]; step > 0) {
    const double knot = hermite(knots_[i], knot_slopes_[i], knots_[i + 1], knot_slopes_[i + 1], h, u);
    pose.position = hermite(keys_[i].position, tangents_[i], keys_[i + 1].position, tangents_[i + 1], step,
                            std::clamp((knot - knots_[i]) / step, 0.0, 1.0));
  }
  const Q &a = rotations_[i], &b = rotations_[i + 1];
  const Q q = bezier(
      {a, a * from_half_turn(turns_[i] * (h / 3)), b * from_half_turn(turns_[i + 1] * (-h / 3)), b}, u);
  pose.world_from_camera = glm::mat3_cast(q);
  pose.time = std::clamp(pose.time, 0.0, 1.0);
  return pose;
}

}  // namespace traceflow::viz
