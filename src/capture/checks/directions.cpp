#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/robust.h"
#include "capture/checks/checks.h"

namespace traceflow {

namespace {

// If at least this fraction of the cameras have the common target in their images, a camera looks away when
// the angle between its axis and the target exceeds this many half diagonals of its image.
constexpr double agreeing_share = 0.9;
constexpr double away_half_diagonals = 1.5;

Vec3<double> axis_of(const View& view) {
  return Vec3<double>(Vec3<float>(0, 0, 1) * view.camera.camera_from_world);
}

// The largest angle between the axis and a corner of the image.
double half_diagonal(const Camera<float>& camera) {
  double largest = 0;
  for (const float x : {0.0F, static_cast<float>(camera.width)}) {
    for (const float y : {0.0F, static_cast<float>(camera.height)}) {
      const Vec3<double> ray = normalize(Vec3<double>(camera.ray_in_camera(x, y)));
      largest = std::max(largest, std::acos(std::clamp(ray.z, -1.0, 1.0)));
    }
  }
  return largest;
}

double angle_to(const View& view, const Vec3<double>& place) {
  const Vec3<double> to = place - Vec3<double>(view.camera.position);
  const double far = length(to);
  return far > 0 ? std::acos(std::clamp(dot(axis_of(view), to) / far, -1.0, 1.0)) : 0;
}

// The point with the least sum of distances to the optical axes. Unlike squared distances, the sum gives few
// outliers little weight. A tiny pull to the mean of the cameras keeps parallel axes solvable.
Vec3<double> place_looked_at(const std::vector<View>& views) {
  constexpr int rounds = 30;
  constexpr double trifle = 1e-6;
  Vec3<double> middle(0), place(0);
  for (const View& view : views)
    middle += Vec3<double>(view.camera.position) / static_cast<double>(views.size());
  std::vector<double> weights(views.size(), 1);
  for (int round = 0; round < rounds; ++round) {
    Mat3<double> matrix(0);
    Vec3<double> right(0);
    double total = 0;
    for (size_t i = 0; i < views.size(); ++i) {
      const Vec3<double> axis = axis_of(views[i]);
      const Mat3<double> across = weights[i] * (Mat3<double>(1) - outerProduct(axis, axis));
      matrix += across;
      right += across * Vec3<double>(views[i].camera.position);
      total += weights[i];
    }
    place = inverse(matrix + trifle * total * Mat3<double>(1)) * (right + trifle * total * middle);
    std::vector<double> distances;
    distances.reserve(views.size());
    for (const View& view : views)
      distances.push_back(length(cross(axis_of(view), place - Vec3<double>(view.camera.position))));
    const double floor = std::max(1e-12, 0.1 * median(distances));
    for (size_t i = 0; i < views.size(); ++i) weights[i] = 1 / std::max(floor, distances[i]);
  }
  return place;
}

}  // namespace

void check_directions(const Capture& capture, Findings& findings) {
  if (capture.train.size() < fewest_views) return;
  const Vec3<double> place = place_looked_at(capture.train);
  const auto seeing = std::ranges::count_if(
      capture.train, [&](const View& view) { return angle_to(view, place) <= half_diagonal(view.camera); });
  if (static_cast<double>(seeing) < agreeing_share * static_cast<double>(capture.train.size())) return;

  std::vector<std::string> away;
  double worst = 0, threshold = 0;
  for (const auto* split : {&capture.train, &capture.test}) {
    for (const View& view : *split) {
      const double angle = angle_to(view, place);
      const double limit = std::min(away_half_diagonals * half_diagonal(view.camera), std::numbers::pi / 2);
      if (angle <= limit) continue;
      away.push_back(view.id);
      if (angle > worst) worst = angle, threshold = limit;
    }
  }
  if (away.empty()) return;
  Finding& finding = findings.emplace_back(
      fmt::format("{} ({}), by up to {:.0f}°, from where the others look",
                  away.size() == 1 ? "a camera looks away" : fmt::format("{} cameras look away", away.size()),
                  ids_text(away), glm::degrees(worst)),
      "looks-away");
  finding.views = std::move(away);
  finding.value = glm::degrees(worst);
  finding.threshold = glm::degrees(threshold);
}

}  // namespace traceflow
