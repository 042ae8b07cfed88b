#include "train/density.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/parallel.h"
#include "math/rotation.h"
#include "train/density_kernels.h"

namespace traceflow {

namespace {

// A split surfel's children are this many times smaller, as in 2DGS.
constexpr float split_shrink = 1.6F;

float largest_scale(const Surfels& s, int64_t i) {
  return std::exp(std::max(s.log_scale(i, 0), s.log_scale(i, 1)));
}

// Moves a child to a point drawn from its parent's own Gaussian and shrinks it.
void scatter_child(Surfels& s, int64_t i, Random& random) {
  const Mat3<float> rotation = rotation_from_quaternion(load4<float>(s.rotation.row(i)));
  const auto u = static_cast<float>(random.normal());
  const auto v = static_cast<float>(random.normal());
  add3(s.position.row(i),
       u * std::exp(s.log_scale(i, 0)) * rotation[0] + v * std::exp(s.log_scale(i, 1)) * rotation[1]);
  s.log_scale(i, 0) -= std::log(split_shrink);
  s.log_scale(i, 1) -= std::log(split_shrink);
}

}  // namespace

void DensityControl::accumulate(const Tensor<float>& signal, const Tensor<uint8_t>& touched) {
  require(signal.size() == sum_.size() && touched.size() == sum_.size(), "density statistics cover the set",
          std::to_string(signal.size()) + " for " + std::to_string(sum_.size()));
  move_statistics(signal.device());
  parallel_for(signal.device(), "density: accumulate", sum_.size(),
               AccumulateSignal{signal.data(), touched.data(), sum_.data(), seen_.data()});
}

void DensityControl::move_statistics(Device device) {
  if (sum_.device() == device) return;
  sum_ = sum_.on(device);
  seen_ = seen_.on(device);
}

std::vector<DensityControl::Fate> DensityControl::fates(const Surfels& surfels, const SceneSize& size,
                                                        int64_t cap, bool& at_cap) const {
  const int64_t count = surfels.count();
  const float faint = std::log(options_.prune_opacity / (1 - options_.prune_opacity));
  const float widest = std::min(options_.prune_above * size.extent, options_.prune_above_cloud * size.cloud);
  std::vector<Fate> fate(static_cast<size_t>(count), Fate::keep);
  std::vector<int64_t> growing;
  int64_t left = 0;
  for (int64_t i = 0; i < count; ++i) {
    const float scale = largest_scale(surfels, i);
    Fate& f = fate[static_cast<size_t>(i)];
    if (!(surfels.opacity_logit[i] >= faint)) {
      f = Fate::prune_transparent;
    } else if (!(scale <= widest)) {
      f = Fate::prune_large;
    } else {
      ++left;
      if (mean_signal(i) > options_.gradient_threshold) growing.push_back(i);
    }
  }
  // Either way of multiplying adds one surfel; where there is no room for all, those with the largest signal
  // go first.
  const int64_t room = std::max<int64_t>(0, cap - left);
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
    const bool small = largest_scale(surfels, i) <= options_.clone_below * size.extent;
    fate[static_cast<size_t>(i)] = small ? Fate::clone : Fate::split;
  }
  return fate;
}

events::DensityChanged DensityControl::update(Surfels& surfels, SurfelMoments& moments, const SceneSize& size,
                                              int64_t cap, Random& random) {
  events::DensityChanged change;
  change.set = set_;
  move_statistics(Device::cpu);
  const std::vector<Fate> fate = fates(surfels, size, cap, change.at_cap);
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
  // A set without surfels cannot be rendered or grow again: the last ones stay.
  if (change.pruned_transparent + change.pruned_large == surfels.count()) {
    change.pruned_transparent = change.pruned_large = 0;
    change.count = surfels.count();
    return change;
  }

  RowEdit edit;
  for (size_t i = 0; i < fate.size(); ++i) {
    if (fate[i] == Fate::keep || fate[i] == Fate::clone) edit.keep(static_cast<int64_t>(i));
  }
  change.cloned = each(Fate::clone, [&](int64_t i) { edit.add(i); });
  const int64_t first_child = edit.count();
  change.split = each(Fate::split, [&](int64_t i) {
    edit.add(i);
    edit.add(i);
  });
  edit_rows(surfels, edit);
  moments.edit(edit);
  for (int64_t i = first_child; i < edit.count(); ++i) scatter_child(surfels, i, random);

  sum_.reset({edit.count()});
  seen_.reset({edit.count()});
  change.count = edit.count();
  return change;
}

void DensityControl::reset_opacity(Surfels& surfels, SurfelMoments& moments) const {
  const float ceiling = std::log(options_.opacity_reset / (1 - options_.opacity_reset));
  for (float& logit : surfels.opacity_logit.values()) logit = std::min(logit, ceiling);
  moments.opacity_logit.first.zero();
  moments.opacity_logit.second.zero();
}

void DensityControl::put(Safetensors& file) const {
  if (sum_.empty()) return;
  file.add("density/" + set_ + "/sum", sum_.on(Device::cpu));
  file.add("density/" + set_ + "/seen", seen_.on(Device::cpu));
}

void DensityControl::get(const Safetensors& file) {
  if (sum_.empty()) return;
  Tensor<float> sum = file.tensor<float>("density/" + set_ + "/sum");
  Tensor<float> seen = file.tensor<float>("density/" + set_ + "/seen");
  if (sum.shape() != sum_.shape() || seen.shape() != seen_.shape()) {
    throw InputError("checkpoint", "density/" + set_, sum.shape().to_string(), sum_.shape().to_string());
  }
  sum_ = std::move(sum);
  seen_ = std::move(seen);
}

}  // namespace traceflow
