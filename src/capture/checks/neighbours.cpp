#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "base/robust.h"
#include "capture/checks/checks.h"
#include "capture/formats/image_names.h"
#include "capture/image_cache.h"

namespace traceflow {

namespace {

constexpr size_t window = 3;           // neighbours on each side that an image's sharpness is compared with
constexpr double film_share = 0.6;     // difference of successive images, relative to that of distant ones
constexpr double blur_share = 0.4;     // of the neighbours' median sharpness
constexpr double blur_deviations = 6;  // below that median, in deviations of the logarithm
constexpr double jump_stops = 0.75;    // between successive images,
constexpr double jump_steps = 6;       // and in median steps
constexpr double frozen_share = 0.05;  // of the median difference between successive images

// One camera's readable views of both splits, ordered by time and, at equal times, by number.
using Sequence = std::vector<const ViewFacts*>;

std::vector<Sequence> sequences(const Capture& capture, const std::vector<ViewFacts>& facts) {
  std::map<std::string, Sequence> by_camera;
  std::set<std::string> seen;
  for (const ViewFacts& view : facts) {
    if (!view.broken.empty() || !seen.insert(view.view->id).second) continue;
    by_camera[capture.images->source(view.view->id).rig_camera].push_back(&view);
  }
  std::vector<Sequence> result;
  for (auto& [camera, sequence] : by_camera) {
    std::ranges::stable_sort(sequence, [](const ViewFacts* a, const ViewFacts* b) {
      if (a->view->time != b->view->time) return a->view->time < b->view->time;
      return natural_less(a->view->id, b->view->id);
    });
    if (sequence.size() >= fewest_views) result.push_back(std::move(sequence));
  }
  return result;
}

// The result of one check over all sequences.
struct Found {
  std::vector<std::string> views;
  double worst = 0, threshold = 0;
  bool less_is_worse = false;

  void add(const ViewFacts& view, double value, double limit) {
    if (views.empty() || (less_is_worse ? value < worst : value > worst)) worst = value, threshold = limit;
    views.push_back(view.view->id);
  }
  void tell(const std::string& text, const std::string& kind, Findings& findings) {
    Finding& finding = findings.emplace_back(text, kind);
    finding.views = std::move(views);
    finding.value = worst;
    finding.threshold = threshold;
  }
};

double difference(const Tensor<uint8_t>& a, const Tensor<uint8_t>& b) {
  if (a.shape() != b.shape()) return 255;
  int64_t sum = 0;
  for (int64_t i = 0; i < a.size(); ++i) sum += std::abs(int{a[i]} - int{b[i]});
  return static_cast<double>(sum) / static_cast<double>(a.size());
}

double usual_difference(const Sequence& sequence, size_t lag) {
  std::vector<double> differences;
  for (size_t i = 0; i + lag < sequence.size(); ++i)
    differences.push_back(difference(sequence[i]->thumbnail, sequence[i + lag]->thumbnail));
  return median(std::move(differences));
}

// Whether successive images form a video: their difference is clearly less than that of images far apart in
// the sequence. Several distances are tried, since a video may return to where it was. In a collection of
// photographs, successive images are unrelated.
bool is_film(const Sequence& sequence) {
  double far = 0;
  for (const size_t parts : {2, 3, 4})
    far = std::max(far, usual_difference(sequence, sequence.size() / parts));
  return usual_difference(sequence, 1) <= film_share * far;
}

void find_blur(const Sequence& sequence, Found& found) {
  std::vector<double> shares(sequence.size(), 1), logarithms;
  for (size_t i = 0; i < sequence.size(); ++i) {
    std::vector<double> around;
    for (size_t j = i < window ? 0 : i - window; j <= std::min(i + window, sequence.size() - 1); ++j) {
      if (j != i) around.push_back(sequence[j]->sharpness);
    }
    const double usual = median(std::move(around));
    if (!(sequence[i]->sharpness > 0 && usual > 0)) continue;
    shares[i] = sequence[i]->sharpness / usual;
    logarithms.push_back(std::log(shares[i]));
  }
  const double limit = std::min(blur_share, std::exp(-blur_deviations * robust_deviation(logarithms)));
  for (size_t i = 0; i < sequence.size(); ++i) {
    if (shares[i] < limit) found.add(*sequence[i], shares[i], limit);
  }
}

void find_jumps(const Sequence& whole, Found& found) {
  Sequence sequence;
  std::ranges::copy_if(whole, std::back_inserter(sequence),
                       [](const ViewFacts* view) { return view->exposure.has_value(); });
  std::vector<double> steps, sizes;
  for (size_t i = 1; i < sequence.size(); ++i) {
    steps.push_back(*sequence[i]->exposure - *sequence[i - 1]->exposure);
    sizes.push_back(std::abs(steps.back()));
  }
  const double limit = std::max(jump_stops, jump_steps * median(sizes));
  for (size_t i = 0; i < steps.size(); ++i) {
    if (sizes[i] <= limit) continue;
    found.add(*sequence[i + 1], sizes[i], limit);
    // One odd image causes two jumps; it is reported once.
    if (i + 1 < steps.size() && sizes[i + 1] > limit && std::abs(steps[i] + steps[i + 1]) < limit) ++i;
  }
}

void find_frozen(const Sequence& sequence, Found& found) {
  std::vector<double> differences;
  for (size_t i = 1; i < sequence.size(); ++i)
    differences.push_back(difference(sequence[i - 1]->thumbnail, sequence[i]->thumbnail));
  const double limit = frozen_share * median(differences);
  for (size_t i = 0; i < differences.size(); ++i) {
    const bool is_known = !sequence[i]->is_uniform && !sequence[i + 1]->is_uniform;
    if (is_known && differences[i] <= limit) found.add(*sequence[i + 1], differences[i], limit);
  }
}

}  // namespace

void check_neighbours(const Capture& capture, const std::vector<ViewFacts>& facts, Findings& findings) {
  Found blurred, jumping, frozen;
  blurred.less_is_worse = frozen.less_is_worse = true;
  for (const Sequence& sequence : sequences(capture, facts)) {
    find_frozen(sequence, frozen);
    if (!is_film(sequence)) continue;
    find_blur(sequence, blurred);
    find_jumps(sequence, jumping);
  }
  const auto views = [](const Found& found) {
    return found.views.size() == 1 ? "1 view" : std::to_string(found.views.size()) + " views";
  };
  if (!blurred.views.empty()) {
    blurred.tell(
        fmt::format("{} blurred ({}): as little as {:.0f}% of the sharpness of the neighbours in time",
                    views(blurred), ids_text(blurred.views), 100 * blurred.worst),
        "blur", findings);
  }
  if (!jumping.views.empty()) {
    jumping.tell(fmt::format("the brightness jumps by up to {:.1f} stops at {} ({})", jumping.worst,
                             views(jumping), ids_text(jumping.views)),
                 "exposure-jump", findings);
  }
  if (!frozen.views.empty()) {
    frozen.tell(fmt::format("{} the same picture as the one before ({})",
                            frozen.views.size() == 1 ? "1 view has" : views(frozen) + " have",
                            ids_text(frozen.views)),
                "frozen", findings);
  }
}

}  // namespace traceflow
