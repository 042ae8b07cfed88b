#include "train/density.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/parallel.h"
#include "math/activation.h"
#include "train/density_kernels.h"

namespace traceflow {

namespace {

float largest_scale(const Tensor<float>& log_scale, int64_t i) {
  return std::exp(std::max(log_scale(i, 0), log_scale(i, 1)));
}

Tensor<float> drawn_normal(int64_t count, Random& random) {
  Tensor<float> drawn({count});
  for (float& number : drawn.values()) number = static_cast<float>(random.normal());
  return drawn;
}

}  // namespace

void DensityControl::accumulate(const Tensor<float>& signal, const Tensor<uint8_t>& touched) {
  require(signal.size() == sum_.size() && touched.size() == sum_.size(), "density statistics cover the set",
          std::to_string(signal.size()));
  parallel_for(signal.device(), "density: accumulate", sum_.size(),
               AccumulateSignal{signal.data(), touched.data(), sum_.data(), seen_.data()});
}

std::vector<DensityControl::Fate> DensityControl::fates(const Surfels& surfels, const DensityLimits& limits,
                                                        bool& at_cap) const {
  Tensor<float> fetched[4];
  const Tensor<float>&log_scale = on_host(surfels.log_scale, fetched[0]),
        &opacity_logit = on_host(surfels.opacity_logit, fetched[1]), &sum = on_host(sum_, fetched[2]),
        &seen = on_host(seen_, fetched[3]);
  const auto mean_signal = [&](int64_t i) { return seen[i] > 0 ? sum[i] / seen[i] : 0; };
  const int64_t count = surfels.count();
  const float faint = logit(options_.prune_opacity);
  const SceneSize& size = limits.size;
  const float widest = limits.prunes_large ? std::min(options_.prune_above * size.extent,
                                                      options_.prune_above_cloud * size.cloud)
                                           : std::numeric_limits<float>::max();
  std::vector<Fate> fate(static_cast<size_t>(count), Fate::keep);
  std::vector<int64_t> growing;
  int64_t left = 0;
  for (int64_t i = 0; i < count; ++i) {
    const float scale = largest_scale(log_scale, i);
    Fate& f = fate[static_cast<size_t>(i)];
    if (!(opacity_logit[i] >= faint) && (limits.prunes_faint || std::isnan(opacity_logit[i]))) {
      f = Fate::prune_transparent;
    } else if (!(scale <= widest)) {
      f = Fate::prune_large;
    } else {
      ++left;
      if (mean_signal(i) > options_.gradient_threshold) growing.push_back(i);
    }
  }
  // Cloning and splitting each add one surfel. If there is not room for all, those with the largest signal
  // come first.
  const int64_t room = std::max<int64_t>(0, limits.cap - left);
  const auto share = static_cast<int64_t>(static_cast<double>(options_.growth) * static_cast<double>(count));
  const int64_t allowed = std::min(room, std::max<int64_t>(1, share));
  const auto wanted = static_cast<int64_t>(growing.size());
  at_cap = wanted > room && room < share;
  if (wanted > allowed) {
    std::stable_sort(growing.begin(), growing.end(),
                     [&](int64_t a, int64_t b) { return mean_signal(a) > mean_signal(b); });
    growing.resize(static_cast<size_t>(allowed));
  }
  for (const int64_t i : growing) {
    const bool small = largest_scale(log_scale, i) <= options_.clone_below * size.extent;
    fate[static_cast<size_t>(i)] = small ? Fate::clone : Fate::split;
  }
  return fate;
}

events::DensityChanged DensityControl::update(Surfels& surfels, SurfelMoments& moments,
                                              const DensityLimits& limits, Random& random) {
  events::DensityChanged change;
  change.set = set_;
  const std::vector<Fate> fate = fates(surfels, limits, change.at_cap);
  const auto each = [&](Fate wanted, auto&& f) {
    int64_t found = 0;
    for (size_t i = 0; i < fate.size(); ++i) {
      if (fate[i] != wanted) continue;
      f(static_cast<int64_t>(i));
      ++found;
    }
    return found;
  };
  change.pruned_transparent = each(Fate::prune_transparent, [](int64_t) {});
  change.pruned_large = each(Fate::prune_large, [](int64_t) {});
  // A set without surfels could not be rendered or grow again, so nothing is removed.
  if (change.pruned_transparent + change.pruned_large == surfels.count()) {
    change.pruned_transparent = change.pruned_large = 0;
    change.count = surfels.count();
    return change;
  }

  RowEdit edit;
  std::vector<int64_t> sharing;  // rows of cloned surfels and of their clones
  for (size_t i = 0; i < fate.size(); ++i) {
    if (fate[i] == Fate::clone) sharing.push_back(edit.count());
    if (fate[i] == Fate::keep || fate[i] == Fate::clone) edit.keep(static_cast<int64_t>(i));
  }
  change.cloned = each(Fate::clone, [&](int64_t i) {
    sharing.push_back(edit.count());
    edit.add(i);
  });
  const int64_t first_child = edit.count();
  change.split = each(Fate::split, [&](int64_t i) {
    edit.add(i);
    edit.add(i);
  });
  // All new tensors are made before any is replaced, so that running out of memory leaves the set unchanged.
  const Device device = surfels.device();
  const PlacedEdit placed(edit, device);
  Surfels edited = edited_rows(surfels, placed);
  SurfelMoments edited_moments = moments.edited(placed);
  Tensor<float> sum({edit.count()}, device), seen({edit.count()}, device);
  const int64_t children = edit.count() - first_child;
  const Tensor<float> drawn = drawn_normal(2 * children, random).on(device);
  const Tensor<int64_t> rows = tensor_of(sharing).on(device);
  parallel_for(device, "density: scatter children", children,
               ScatterChild{first_child, drawn.data(), edited.position.data(), edited.log_scale.data(),
                            edited.rotation.data()});
  if (options_.clones_share_opacity) {
    parallel_for(device, "density: share opacities", rows.size(),
                 ShareOpacity{rows.data(), logit(options_.prune_opacity), edited.opacity_logit.data()});
  }
  surfels = std::move(edited);
  moments = std::move(edited_moments);
  sum_ = std::move(sum);
  seen_ = std::move(seen);
  change.count = edit.count();
  return change;
}

events::DensityChanged DensityControl::add(Surfels& surfels, SurfelMoments& moments, const Surfels& more) {
  const Device device = surfels.device();
  RowEdit edit;
  for (int64_t i = 0; i < surfels.count(); ++i) edit.keep(i);
  for (int64_t i = 0; i < more.count(); ++i) edit.add(0);
  const PlacedEdit placed(edit, device);
  Surfels joined = surfels.on(Device::cpu);
  append_rows(joined, more);
  joined = joined.on(device);
  SurfelMoments joined_moments = moments.edited(placed);
  Tensor<float> sum = edited_rows(sum_, placed, true), seen = edited_rows(seen_, placed, true);
  surfels = std::move(joined);
  moments = std::move(joined_moments);
  sum_ = std::move(sum);
  seen_ = std::move(seen);
  events::DensityChanged change;
  change.set = set_;
  change.added = more.count();
  change.count = surfels.count();
  return change;
}

void DensityControl::shorten_needles(Surfels& surfels, float cloud) const {
  if (options_.longest_needle == 0) return;
  constexpr float aspect = 10;
  parallel_for(
      surfels.device(), "density: shorten needles", surfels.count(),
      ShortenNeedle{std::log(aspect), std::log(options_.longest_needle * cloud), surfels.log_scale.data()});
}

void DensityControl::shorten_unseen(Surfels& surfels, const Tensor<Camera<float>>& cameras,
                                    float cloud) const {
  if (!(options_.longest_unseen * cloud > 0)) return;
  parallel_for(
      surfels.device(), "density: shorten unseen", surfels.count(),
      ShortenUnseen{cameras.data(), cameras.size(), surfels.body.empty() ? nullptr : surfels.body.data(),
                    surfels.position.data(), surfels.rotation.data(), options_.longest_unseen * cloud,
                    surfels.log_scale.data()});
}

void DensityControl::reset_opacity(Surfels& surfels, SurfelMoments& moments) const {
  const float ceiling = logit(options_.opacity_reset);
  parallel_for(surfels.device(), "density: lower opacity", surfels.count(),
               LowerTo{ceiling, surfels.opacity_logit.data()});
  moments.opacity_logit.first.zero();
  moments.opacity_logit.second.zero();
}

void DensityControl::put(Safetensors& file) const {
  if (sum_.empty()) return;
  file.add("density/" + set_ + "/sum", sum_);
  file.add("density/" + set_ + "/seen", seen_);
}

void DensityControl::get(const Safetensors& file) {
  if (sum_.empty()) return;
  const Tensor<float> sum = file.tensor<float>("density/" + set_ + "/sum");
  const Tensor<float> seen = file.tensor<float>("density/" + set_ + "/seen");
  if (sum.shape() != sum_.shape() || seen.shape() != seen_.shape()) {
    throw InputError("checkpoint", "density/" + set_, sum.shape().to_string(), sum_.shape().to_string());
  }
  sum_ = sum.on(sum_.device());
  seen_ = seen.on(seen_.device());
}

}  // namespace traceflow
