#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "base/robust.h"
#include "capture/checks/checks.h"
#include "capture/extent.h"

namespace traceflow {

namespace {

// Distance from the centre, in median distances, and beyond the median in deviations.
constexpr double apart_distance = 3;
constexpr double apart_deviations = 6;
// A path that leads outwards step by step has no outliers. In usual steps of the path.
constexpr double connected_steps = 3;
// Above this fraction, the distant cameras are a second group and not outliers.
constexpr double group_share = 0.1;

using Positions = std::vector<Vec3<double>>;

Vec3<double> middle_of(const Positions& positions) {
  Vec3<double> middle;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Vec3<double>& p : positions) values.push_back(p[axis]);
    middle[axis] = median(std::move(values));
  }
  return middle;
}

// The 90th percentile of a camera's distance to the nearer of its two neighbours in time. For an outlier both
// neighbours are far; for its neighbours only one is.
double usual_step(std::vector<const View*> views) {
  std::ranges::stable_sort(views, {}, &View::time);
  std::vector<float> steps(views.size(), std::numeric_limits<float>::infinity());
  for (size_t i = 1; i < views.size(); ++i) {
    const float step = distance(views[i]->camera.position, views[i - 1]->camera.position);
    steps[i - 1] = std::min(steps[i - 1], step);
    steps[i] = step;
  }
  return ranked(steps, (steps.size() - 1) * 9 / 10);
}

// Removes from `far` the cameras that a chain of gaps of at most max_gap connects to a camera not in `far`.
void connect(const Positions& positions, double max_gap, std::vector<bool>& far) {
  std::vector<size_t> reached;
  for (size_t i = 0; i < far.size(); ++i) {
    if (!far[i]) reached.push_back(i);
  }
  for (size_t next = 0; next < reached.size(); ++next) {
    for (size_t i = 0; i < far.size(); ++i) {
      if (!far[i] || distance(positions[i], positions[reached[next]]) > max_gap) continue;
      far[i] = false;
      reached.push_back(i);
    }
  }
}

std::string extent_text(const Capture& capture, const std::vector<std::string>& apart) {
  Positions rest;
  for (const View& view : capture.train) {
    if (std::ranges::find(apart, view.id) == apart.end()) rest.emplace_back(view.camera.position);
  }
  if (rest.size() == capture.train.size()) return "";
  return fmt::format("; without {} the scene's extent would be {:.3g} instead of {:.3g}",
                     apart.size() == 1 ? "it" : "them", camera_extent(rest), capture.extent);
}

}  // namespace

void check_positions(const Capture& capture, Findings& findings) {
  if (capture.train.size() < fewest_views) return;
  std::vector<const View*> views;
  Positions train, all;
  for (const View& view : capture.train) views.push_back(&view), train.emplace_back(view.camera.position);
  const double step = usual_step(views);
  all = train;
  for (const View& view : capture.test) views.push_back(&view), all.emplace_back(view.camera.position);

  const Vec3<double> middle = middle_of(train);
  std::vector<double> distances;
  for (const Vec3<double>& p : train) distances.push_back(distance(p, middle));
  const double usual = median(distances);
  if (!(usual > 0)) return;
  const double limit =
      std::max(apart_distance * usual, usual + apart_deviations * robust_deviation(distances));
  std::vector<bool> far;
  for (const Vec3<double>& p : all) far.push_back(distance(p, middle) > limit);
  connect(all, std::max(connected_steps * step, usual), far);

  std::vector<std::string> apart;
  double worst = 0;
  for (size_t i = 0; i < all.size(); ++i) {
    if (!far[i]) continue;
    apart.push_back(views[i]->id);
    worst = std::max(worst, distance(all[i], middle) / usual);
  }
  if (apart.empty() ||
      static_cast<double>(apart.size()) > std::max(1.0, group_share * static_cast<double>(all.size())))
    return;
  Finding& finding = findings.emplace_back(
      fmt::format(
          "{} ({}): up to {:.1f} times as far from the middle as the others{}",
          apart.size() == 1 ? "a camera stands apart" : fmt::format("{} cameras stand apart", apart.size()),
          ids_text(apart), worst, extent_text(capture, apart)),
      "camera-apart");
  finding.views = std::move(apart);
  finding.value = worst;
  finding.threshold = limit / usual;
}

}  // namespace traceflow
