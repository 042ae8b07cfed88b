#include <fmt/format.h>

#include <algorithm>

#include "base/robust.h"
#include "capture/checks/checks.h"

namespace traceflow {

namespace {

constexpr double empty_share = 0.1;  // of a view's pixels
constexpr double wide_angle = 60;    // degrees, over all views; random directions have 90
// Limits for one view against the median of all: degrees, and deviations.
constexpr double odd_angle = 15;
constexpr double odd_deviations = 6;
// Relative errors of depths: of half of the views, and of one view against the median of all.
constexpr double wrong_depth = 0.25;
constexpr double odd_depth = 0.15;

void check_empty(const std::vector<ViewFacts>& facts, Findings& findings) {
  std::vector<std::string> empty;
  size_t count = 0;
  double worst = 1;
  for (const ViewFacts& view : facts) {
    if (!view.with_prior) continue;
    ++count;
    if (*view.with_prior >= empty_share) continue;
    empty.push_back(view.view->id);
    worst = std::min(worst, *view.with_prior);
  }
  if (empty.empty()) return;
  Finding& finding = findings.emplace_back(
      fmt::format("{} of {} normal priors are almost empty ({})", empty.size(), count, ids_text(empty)),
      "prior-empty");
  finding.views = empty;
  finding.value = worst;
  finding.threshold = empty_share;
}

void check_angles(const std::vector<ViewFacts>& facts, Findings& findings) {
  std::vector<double> angles;
  for (const ViewFacts& view : facts) {
    if (view.prior_angle) angles.push_back(*view.prior_angle);
  }
  const double usual = median(angles);
  if (usual > wide_angle) {
    Finding& finding = findings.emplace_back(
        fmt::format(
            "the normal priors are {:.0f}° from planes through the points, in half of the views or more",
            usual),
        "prior-disagrees");
    finding.value = usual;
    finding.threshold = wide_angle;
    return;
  }
  if (angles.size() < fewest_views) return;
  const double limit = usual + std::max(odd_angle, odd_deviations * robust_deviation(angles));
  std::vector<std::string> odd;
  double worst = 0;
  for (const ViewFacts& view : facts) {
    if (!view.prior_angle || *view.prior_angle <= limit) continue;
    odd.push_back(view.view->id);
    worst = std::max(worst, *view.prior_angle);
  }
  if (odd.empty()) return;
  Finding& finding = findings.emplace_back(
      fmt::format(
          "{} normal {} with the geometry ({}): up to {:.0f}° from planes through the points, where {:.0f}° "
          "is usual",
          odd.size(), odd.size() == 1 ? "prior disagrees" : "priors disagree", ids_text(odd), worst, usual),
      "prior-disagrees");
  finding.views = std::move(odd);
  finding.value = worst;
  finding.threshold = limit;
}

}  // namespace

void check_priors(const std::vector<ViewFacts>& facts, Findings& findings) {
  check_empty(facts, findings);
  check_angles(facts, findings);
}

void check_depths(const std::vector<ViewFacts>& facts, Findings& findings) {
  std::vector<double> errors;
  for (const ViewFacts& view : facts) {
    if (view.depth_error) errors.push_back(*view.depth_error);
  }
  const double usual = median(errors);
  if (usual > wrong_depth) {
    Finding& finding = findings.emplace_back(
        fmt::format("the depth priors are {:.0f}% off the points, in half of the views or more", 100 * usual),
        "depth-disagrees");
    finding.value = usual;
    finding.threshold = wrong_depth;
    return;
  }
  if (errors.size() < fewest_views) return;
  const double limit = usual + std::max(odd_depth, odd_deviations * robust_deviation(errors));
  std::vector<std::string> odd;
  double worst = 0;
  for (const ViewFacts& view : facts) {
    if (!view.depth_error || *view.depth_error <= limit) continue;
    odd.push_back(view.view->id);
    worst = std::max(worst, *view.depth_error);
  }
  if (odd.empty()) return;
  Finding& finding = findings.emplace_back(
      fmt::format("{} depth {} with the geometry ({}): up to {:.0f}% off the points, where {:.0f}% is usual",
                  odd.size(), odd.size() == 1 ? "prior disagrees" : "priors disagree", ids_text(odd),
                  100 * worst, 100 * usual),
      "depth-disagrees");
  finding.views = std::move(odd);
  finding.value = worst;
  finding.threshold = limit;
}

}  // namespace traceflow
