#include <fmt/format.h>

#include "capture/checks/checks.h"

namespace traceflow {

namespace {

constexpr double inverted_share = 0.6;  // of the pixels of all views
constexpr double full_share = 0.98;     // of the pixels of one view

}  // namespace

void check_masks(const std::vector<ViewFacts>& facts, Findings& findings) {
  std::vector<std::string> empty, full;
  double sum = 0;
  size_t count = 0;
  for (const ViewFacts& view : facts) {
    if (!view.masked) continue;
    ++count;
    sum += *view.masked;
    if (*view.masked == 0) empty.push_back(view.view->id);
    if (*view.masked > full_share) full.push_back(view.view->id);
  }
  if (count == 0) return;
  const double mean = sum / static_cast<double>(count);
  if (mean > inverted_share) {
    Finding& finding = findings.emplace_back(
        "the masks cover most of the image: mask/ has the object white, resized_mask/ black; are they the "
        "other "
        "way round?",
        "mask-inverted");
    finding.value = mean;
    finding.threshold = inverted_share;
    return;
  }
  if (empty.size() == count) {
    findings.emplace_back("the masks are empty", "mask-empty").views = empty;
  } else if (!empty.empty()) {
    findings
        .emplace_back(fmt::format("{} of {} masks are empty ({})", empty.size(), count, ids_text(empty)),
                      "mask-empty", Severity::notice)
        .views = empty;
  }
  if (full.empty()) return;
  Finding& finding = findings.emplace_back(
      fmt::format("{} of {} masks cover the whole image ({})", full.size(), count, ids_text(full)),
      "mask-full");
  finding.views = full;
  finding.value = 1;
  finding.threshold = full_share;
}

}  // namespace traceflow
