#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "base/robust.h"
#include "capture/checks/checks.h"
#include "capture/image_cache.h"

namespace traceflow {

namespace {

constexpr size_t fewest_times = 5;
constexpr double gap_steps = 5;    // in median steps between training times
constexpr double rounding = 1e-3;  // relative error of steps between times in single precision
// If more than this fraction of the views share a time, the capture has several cameras that are not told
// apart.
constexpr double repeated_share = 0.5;

void check_gaps(const Capture& capture, Findings& findings) {
  std::vector<const View*> views;
  for (const View& view : capture.train) views.push_back(&view);
  std::ranges::stable_sort(views, {}, &View::time);
  const auto same = [](const View* a, const View* b) { return a->time == b->time; };
  views.erase(std::unique(views.begin(), views.end(), same), views.end());
  if (views.size() < fewest_times) return;
  std::vector<double> steps;
  for (size_t i = 1; i < views.size(); ++i) steps.push_back(double{views[i]->time} - views[i - 1]->time);
  const double usual = median(steps);

  std::vector<std::string> ends;
  size_t worst = 0, gaps = 0;
  for (size_t i = 0; i < steps.size(); ++i) {
    if (steps[i] <= (1 + rounding) * gap_steps * usual) continue;
    ends.insert(ends.end(), {views[i]->id, views[i + 1]->id});
    if (gaps++ == 0 || steps[i] > steps[worst]) worst = i;
  }
  if (gaps == 0) return;
  Finding& finding = findings.emplace_back(
      fmt::format(
          "no training view between the times {:.3f} and {:.3f} ({} and {}): {:.0f} times the usual step{}",
          views[worst]->time, views[worst + 1]->time, views[worst]->id, views[worst + 1]->id,
          steps[worst] / usual, gaps > 1 ? fmt::format(", and {} more gaps", gaps - 1) : ""),
      "time-gap");
  finding.views = std::move(ends);
  finding.value = steps[worst] / usual;
  finding.threshold = gap_steps;
}

void check_repeats(const Capture& capture, const std::vector<View>& views, const std::string& split,
                   Findings& findings) {
  std::map<std::pair<std::string, float>, std::vector<std::string>> by_time;
  for (const View& view : views)
    by_time[{capture.images->source(view.id).rig_camera, view.time}].push_back(view.id);
  std::vector<std::string> repeated;
  for (const auto& [time, ids] : by_time) {
    if (ids.size() > 1) repeated.insert(repeated.end(), ids.begin(), ids.end());
  }
  if (repeated.empty() ||
      static_cast<double>(repeated.size()) > repeated_share * static_cast<double>(views.size()))
    return;
  Finding& finding =
      findings.emplace_back(fmt::format("{} {} views share their time with another of the same camera ({})",
                                        repeated.size(), split, ids_text(repeated)),
                            "repeated-time");
  finding.value = static_cast<double>(repeated.size());
  finding.views = std::move(repeated);
  finding.threshold = 0;
}

}  // namespace

void check_times(const Capture& capture, Findings& findings) {
  check_gaps(capture, findings);
  check_repeats(capture, capture.train, "training", findings);
  check_repeats(capture, capture.test, "test", findings);
}

}  // namespace traceflow
