#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "base/robust.h"
#include "capture/checks/checks.h"

namespace traceflow {

namespace {

constexpr int64_t sample_size = 4000;
// Large values can be normal: points beside and behind the cameras help, because mirrors show them.
constexpr double unseen_share = 0.8;
constexpr double behind_share = 0.4;
// A view sees hardly any points if it sees less than this fraction of the median view's.
constexpr double few_share = 0.1;
// From the centre of the points, in distances of the median point.
constexpr double far_distance = 30;

struct Sighting {
  std::vector<double> in_view;  // fraction of the points in each training view's image
  double unseen = 0, behind = 0;
};

Sighting look(const Capture& capture) {
  const int64_t step = std::max<int64_t>(1, capture.points.dim(0) / sample_size);
  const int64_t sampled = (capture.points.dim(0) + step - 1) / step;
  const auto count = static_cast<double>(sampled);
  Sighting result;
  std::vector<int64_t> hits(capture.train.size(), 0);
  int64_t unseen = 0, behind = 0;
  for (int64_t i = 0; i < capture.points.dim(0); i += step) {
    const Vec3<float> point = load3<float>(capture.points.row(i));
    bool is_seen = false, is_before = false;
    for (size_t v = 0; v < capture.train.size(); ++v) {
      const Camera<float>& camera = capture.train[v].camera;
      if (!(camera.point_in_camera(point).z > 0)) continue;
      is_before = true;
      if (!camera.sees(point)) continue;
      is_seen = true;
      ++hits[v];
    }
    unseen += is_seen ? 0 : 1;
    behind += is_before ? 0 : 1;
  }
  for (const int64_t n : hits) result.in_view.push_back(static_cast<double>(n) / count);
  result.unseen = static_cast<double>(unseen) / count;
  result.behind = static_cast<double>(behind) / count;
  return result;
}

void emit_unseen(const Sighting& sighting, Findings& findings) {
  const auto is_told = [&](const std::string& kind) {
    return std::ranges::any_of(findings, [&](const Finding& f) { return f.kind == kind; });
  };
  if (sighting.behind > behind_share) {
    Finding& finding = findings.emplace_back(
        fmt::format("{:.1f}% of the points lie behind every training camera", 100 * sighting.behind),
        "points-behind");
    finding.value = sighting.behind;
    finding.threshold = behind_share;
  }
  // If the points behind alone exceed the limit, they are already reported.
  const bool are_behind = sighting.behind > unseen_share;
  if (sighting.unseen > unseen_share && !are_behind && !is_told("points-unseen")) {
    Finding& finding = findings.emplace_back(
        fmt::format("{:.0f}% of the points fall into no training image", 100 * sighting.unseen),
        "points-unseen", Severity::notice);
    finding.value = sighting.unseen;
    finding.threshold = unseen_share;
  }
}

void emit_views_with_few(const Capture& capture, const std::vector<double>& in_view, Findings& findings) {
  if (in_view.size() < fewest_views) return;
  std::set<std::string> told;
  for (const Finding& finding : findings) {
    if (finding.kind == "looks-away" || finding.kind == "camera-apart")
      told.insert(finding.views.begin(), finding.views.end());
  }
  const double limit = few_share * median(in_view);
  std::vector<std::string> few;
  double worst = 1;
  for (size_t v = 0; v < in_view.size(); ++v) {
    if (in_view[v] >= limit || told.contains(capture.train[v].id)) continue;
    few.push_back(capture.train[v].id);
    worst = std::min(worst, in_view[v]);
  }
  if (few.empty()) return;
  Finding& finding = findings.emplace_back(
      fmt::format(
          "{} training {} hardly any of the points ({}): {:.2f}% of them, where half of the views have "
          "more than {:.0f}%",
          few.size(), few.size() == 1 ? "view sees" : "views see", ids_text(few), 100 * worst,
          100 * limit / few_share),
      "few-points");
  finding.views = std::move(few);
  finding.value = worst;
  finding.threshold = limit;
}

void emit_far(const Tensor<float>& points, Findings& findings) {
  std::vector<double> axis[3];
  for (int64_t i = 0; i < points.size(); ++i) axis[i % 3].push_back(double{points[i]});
  const Vec3<double> middle(median(axis[0]), median(axis[1]), median(axis[2]));
  std::vector<double> distances;
  for (int64_t i = 0; i < points.dim(0); ++i)
    distances.push_back(distance(load3<double>(points.row(i)), middle));
  const double usual = median(distances), limit = far_distance * usual;
  const auto far = std::ranges::count_if(distances, [&](double d) { return d > limit; });
  if (far == 0 || !(usual > 0)) return;
  const double worst = *std::ranges::max_element(distances) / usual;
  Finding& finding = findings.emplace_back(
      fmt::format(
          "{} of {} points lie far out, the farthest {:.0f} times as far from the middle as the median", far,
          points.dim(0), worst),
      "points-far", Severity::notice);
  finding.value = worst;
  finding.threshold = far_distance;
}

}  // namespace

Inspection::Sight check_points(const Capture& capture, Findings& findings) {
  if (capture.points.empty()) return {};
  const Sighting sighting = look(capture);
  emit_unseen(sighting, findings);
  emit_views_with_few(capture, sighting.in_view, findings);
  emit_far(capture.points, findings);
  return {median(sighting.in_view), sighting.unseen, sighting.behind};
}

}  // namespace traceflow
