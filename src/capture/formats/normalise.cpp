#include "capture/formats/normalise.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "math/symmetric_eigen.h"

namespace traceflow {

namespace {

struct Box {
  Vec3<double> low{HUGE_VAL}, high{-HUGE_VAL};

  void take(const Vec3<double>& x) {
    low = glm::min(low, x);
    high = glm::max(high, x);
  }
  Vec3<double> centre() const { return 0.5 * (low + high); }
  double diagonal() const { return length(high - low); }
};

// Extends the box around all but the outermost 2.5 % on each side of each axis.
void take_inner(Box& box, const std::vector<Vec3<double>>& places) {
  std::vector<double> values;
  Vec3<double> low(0), high(0);
  for (int axis = 0; axis < 3; ++axis) {
    values.clear();
    for (const Vec3<double>& x : places) {
      if (is_finite(x)) values.push_back(x[axis]);
    }
    if (values.empty()) return;
    std::ranges::sort(values);
    const size_t cut = values.size() / 40;
    low[axis] = values[cut];
    high[axis] = values[values.size() - 1 - cut];
  }
  box.take(low);
  box.take(high);
}

Vec3<double> axis_of(const FoundView& view) {
  return transpose(view.camera_from_world) * Vec3<double>(0, 0, 1);
}

// The scale that gives the box a diagonal of 1. A box that is a single point, up to rounding, keeps the
// capture's units.
double scale_of(const Box& box) {
  constexpr double rounding = 1e-9, largest = 1e12;
  const Vec3<double> corner = glm::max(glm::abs(box.low), glm::abs(box.high));
  const double diagonal = box.diagonal(), farthest = std::max({corner.x, corner.y, corner.z});
  if (!(diagonal > rounding * (1 + farthest))) return 1;
  return std::clamp(1 / diagonal, 1 / largest, largest);
}

// The point with the least sum of squared distances to all optical axes. Returns nothing if the axes are
// nearly parallel or if most cameras look away from the point.
std::optional<Vec3<double>> common_sight(const std::vector<FoundView>& views) {
  constexpr double flattest = 1e-3;
  Mat3<double> sum(0);
  Vec3<double> right(0);
  for (const FoundView& view : views) {
    const Vec3<double> axis = axis_of(view);
    const Mat3<double> across = Mat3<double>(1) - outerProduct(axis, axis);
    sum += across;
    right += across * view.position;
  }
  const auto values = symmetric_eigen(sum).values;
  const auto count = static_cast<double>(views.size());
  if (views.empty() || std::min({values[0], values[1], values[2]}) < flattest * count) return std::nullopt;
  const Vec3<double> sight = inverse(sum) * right;
  const auto in_front = std::ranges::count_if(
      views, [&](const FoundView& view) { return dot(axis_of(view), sight - view.position) > 0; });
  if (2 * in_front < static_cast<std::ptrdiff_t>(views.size())) return std::nullopt;
  return sight;
}

}  // namespace

SceneNormalisation normalise(const std::vector<FoundView>& views, const std::vector<Vec3<double>>& points) {
  std::vector<Vec3<double>> cameras;
  cameras.reserve(views.size());
  for (const FoundView& view : views) cameras.push_back(view.position);
  Box box;
  take_inner(box, cameras);
  take_inner(box, points);
  if (cameras.empty()) return {};
  Vec3<double> centre = box.centre();
  if (points.empty()) {
    const std::optional<Vec3<double>> sight = common_sight(views);
    if (sight) box.take(*sight);
    centre = sight.value_or(box.centre());
  }
  return {centre, scale_of(box)};
}

}  // namespace traceflow
