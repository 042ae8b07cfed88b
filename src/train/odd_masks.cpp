#include "train/odd_masks.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "base/parallel.h"
#include "capture/image_cache.h"

namespace traceflow {

namespace {

constexpr double most_change = 1.7;
constexpr size_t to_each_side = 3;
constexpr size_t least_beside = 2;
constexpr double edge_share = 0.01;  // of the image's width

MaskExtent extent_of(const std::string& id, const Tensor<uint8_t>& mask) {
  MaskExtent extent{id};
  const int64_t height = mask.dim(0), width = mask.dim(1);
  const int64_t edge = std::max<int64_t>(1, static_cast<int64_t>(edge_share * static_cast<double>(width)));
  int64_t covered = 0;
  for (int64_t y = 0; y < height; ++y) {
    for (int64_t x = 0; x < width; ++x) {
      if (mask(y, x) == 0) continue;
      ++covered;
      extent.touches_edge |= std::min({x, y, width - 1 - x, height - 1 - y}) < edge;
    }
  }
  extent.share = static_cast<double>(covered) / static_cast<double>(mask.size());
  return extent;
}

// The indices of up to three non-blank extents on one side of `at`, nearest first.
std::vector<size_t> beside(const std::vector<MaskExtent>& extents, size_t at, std::ptrdiff_t step) {
  std::vector<size_t> found;
  for (auto k = static_cast<std::ptrdiff_t>(at) + step;
       k >= 0 && k < static_cast<std::ptrdiff_t>(extents.size()) && found.size() < to_each_side; k += step) {
    if (extents[static_cast<size_t>(k)].share > 0) found.push_back(static_cast<size_t>(k));
  }
  return found;
}

}  // namespace

std::vector<size_t> odd_extents(const std::vector<MaskExtent>& extents) {
  std::vector<size_t> odd;
  for (size_t i = 0; i < extents.size(); ++i) {
    const std::vector<size_t> before = beside(extents, i, -1), after = beside(extents, i, 1);
    std::vector<double> shares;
    for (const std::vector<size_t>& side : {before, after}) {
      for (const size_t k : side) shares.push_back(extents[k].share);
    }
    if (shares.size() < least_beside) continue;
    const auto middle = shares.begin() + static_cast<std::ptrdiff_t>(shares.size() / 2);
    std::nth_element(shares.begin(), middle, shares.end());
    const auto is_small = [&](size_t k) { return most_change * extents[k].share < *middle; };
    const auto is_leaving = [&](size_t k) { return extents[k].touches_edge && is_small(k); };
    bool leaves = is_leaving(i);
    for (const std::vector<size_t>& side : {before, after})
      leaves = leaves || (!side.empty() && is_leaving(side.front()));
    if ((is_small(i) && !leaves) || extents[i].share > most_change * *middle) odd.push_back(i);
  }
  return odd;
}

void leave_out_odd_masks(Capture& capture) {
  std::vector<const View*> views;
  for (const View& view : capture.train) {
    if (capture.images->has_mask(view.id)) views.push_back(&view);
  }
  std::stable_sort(views.begin(), views.end(),
                   [](const View* a, const View* b) { return a->time < b->time; });
  std::vector<MaskExtent> extents(views.size());
  parallel_for(
      "masks: measure", static_cast<int64_t>(views.size()),
      [&](int64_t i) {
        const std::string& id = views[static_cast<size_t>(i)]->id;
        extents[static_cast<size_t>(i)] = extent_of(id, capture.images->mask(id)->mask);
      },
      1);
  std::map<std::string, std::vector<MaskExtent>> cameras;
  for (MaskExtent& extent : extents)
    cameras[capture.images->source(extent.id).rig_camera].push_back(std::move(extent));
  std::vector<std::string> odd;
  for (const auto& [camera, of_camera] : cameras) {
    for (const size_t i : odd_extents(of_camera)) odd.push_back(of_camera[i].id);
  }
  if (odd.empty()) return;
  capture.images->leave_masks_out(odd);
  Finding& finding = capture.warnings.emplace_back(
      fmt::format("{} of {} masks are not used: each covers much less or much more than those of the times "
                  "beside it ({})",
                  odd.size(), views.size(), ids_text(odd)),
      "mask-odd");
  finding.views = odd;
}

}  // namespace traceflow
