#include "prepare/choose_frames.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace traceflow::prepare {

namespace {

// The candidates from --start to --end.
std::vector<int64_t> within(const std::vector<Candidate>& candidates, const PrepareOptions& options) {
  std::vector<int64_t> kept;
  for (size_t i = 0; i < candidates.size(); ++i) {
    const double time = candidates[i].time;
    if (time >= options.start && (options.end == 0 || time <= options.end))
      kept.push_back(static_cast<int64_t>(i));
  }
  return kept;
}

}  // namespace

std::vector<int64_t> choose_frames(const std::vector<Candidate>& candidates, const PrepareOptions& options) {
  std::vector<int64_t> usable = within(candidates, options);
  const auto count = static_cast<double>(usable.size());
  if (usable.empty() || (options.rate == 0 && count <= options.frames)) return usable;
  const auto at = [&](int64_t i) -> const Candidate& { return candidates[static_cast<size_t>(i)]; };
  const double first = at(usable.front()).time, last = at(usable.back()).time;
  // The last candidate also lasts one interval between candidates.
  const double duration = (last - first) * count / std::max(1.0, count - 1);
  const double interval = options.rate > 0 ? 1 / options.rate : duration / options.frames;
  if (!(interval > 0)) return {usable.front()};

  std::vector<int64_t> chosen;
  int64_t open = -1;
  for (const int64_t i : usable) {
    // Times at a border, up to rounding, belong to the interval that starts there.
    const auto here = static_cast<int64_t>(std::floor((at(i).time - first) / interval + 1e-6));
    if (here != open) {
      chosen.push_back(i);
      open = here;
    } else if (at(i).sharpness > at(chosen.back()).sharpness) {
      chosen.back() = i;
    }
  }
  return chosen;
}

std::vector<int64_t> nearest_frames(const std::vector<Candidate>& candidates,
                                    const std::vector<double>& times, double tolerance) {
  std::vector<int64_t> nearest;
  for (const double time : times) {
    const auto after = std::ranges::lower_bound(candidates, time, {}, &Candidate::time);
    auto best = after;
    if (after == candidates.end() ||
        (after != candidates.begin() && time - std::prev(after)->time <= after->time - time)) {
      best = after == candidates.begin() ? after : std::prev(after);
    }
    const bool found = best != candidates.end() && std::abs(best->time - time) <= tolerance;
    nearest.push_back(found ? best - candidates.begin() : -1);
  }
  const auto distance = [&](size_t i) {
    return std::abs(candidates[static_cast<size_t>(nearest[i])].time - times[i]);
  };
  size_t last = 0;  // the last time so far that keeps its candidate
  for (size_t i = 1; i < times.size(); ++i) {
    if (nearest[i] < 0) continue;
    const bool shared = nearest[last] == nearest[i];
    if (shared && distance(i) >= distance(last)) {
      nearest[i] = -1;
      continue;
    }
    if (shared) nearest[last] = -1;
    last = i;
  }
  return nearest;
}

}  // namespace traceflow::prepare
