#include "prepare/depth_fit.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "base/random.h"
#include "base/robust.h"
#include "capture/image_cache.h"

namespace traceflow::prepare {

namespace {

constexpr size_t fewest_samples = 16;
constexpr double least_inliers = 1.0 / 3;
constexpr double near = 0.1;              // relative error of an inlier
constexpr double most_of_constant = 0.8;  // misfit, as a share of that of one depth for all samples

double target_of(const DepthSample& sample, DepthKind kind) {
  return kind == DepthKind::inverse ? 1 / sample.depth : sample.depth;
}

double relative_error(const DepthFit& fit, const DepthSample& sample) {
  const double depth = fit.depth_of(sample.value);
  return depth > 0 ? std::abs(depth / sample.depth - 1) : 1;
}

// Between 0 and the number of samples: each counts by its error, at most as an outlier. depth_of(sample).
template <class F>
double misfit(const std::vector<DepthSample>& samples, F&& depth_of) {
  double sum = 0;
  for (const DepthSample& sample : samples)
    sum += std::min(1.0, std::abs(depth_of(sample) / sample.depth - 1) / near);
  return sum;
}

// Of the depth that fits all samples best, whatever their values.
double misfit_of_constant(const std::vector<DepthSample>& samples, Random& random) {
  constexpr int tries = 50;
  auto least = static_cast<double>(samples.size());
  for (int k = 0; k < tries; ++k) {
    const double depth =
        samples[static_cast<size_t>(random.below(static_cast<int64_t>(samples.size())))].depth;
    least = std::min(least, misfit(samples, [&](const DepthSample&) { return depth; }));
  }
  return least;
}

int64_t count_inliers(const DepthFit& fit, const std::vector<DepthSample>& samples, double limit) {
  return std::ranges::count_if(samples, [&](const DepthSample& s) { return relative_error(fit, s) < limit; });
}

// Least squares over the samples that are near the fit. The residual of the target, over the target, is the
// relative error of the depth to first order, for either kind.
DepthFit refined(const DepthFit& fit, const std::vector<DepthSample>& samples) {
  double w = 0, wv = 0, wvv = 0, wt = 0, wvt = 0;
  for (const DepthSample& sample : samples) {
    if (relative_error(fit, sample) >= near) continue;
    const double target = target_of(sample, fit.kind), weight = 1 / (target * target);
    w += weight;
    wv += weight * sample.value;
    wvv += weight * sample.value * sample.value;
    wt += weight * target;
    wvt += weight * sample.value * target;
  }
  const double determinant = w * wvv - wv * wv;
  DepthFit better = fit;
  better.scale = (w * wvt - wv * wt) / determinant;
  better.shift = (wvv * wt - wv * wvt) / determinant;
  return better.scale > 0 && std::isfinite(better.shift) ? better : fit;
}

}  // namespace

double DepthFit::depth_of(double value) const {
  const double fitted = scale * value + shift;
  if (!(fitted > 0)) return 0;
  return kind == DepthKind::inverse ? 1 / fitted : fitted;
}

std::optional<DepthFit> fit_depths(const std::vector<DepthSample>& samples, DepthKind kind) {
  constexpr int tries = 300, rounds = 4;
  if (samples.size() < fewest_samples) return std::nullopt;
  Random random(0x6465707468);
  DepthFit best;
  int64_t most = 0;
  for (int k = 0; k < tries; ++k) {
    const auto count = static_cast<int64_t>(samples.size());
    const DepthSample &a = samples[static_cast<size_t>(random.below(count))],
                      &b = samples[static_cast<size_t>(random.below(count))];
    DepthFit fit{kind};
    fit.scale = (target_of(b, kind) - target_of(a, kind)) / (b.value - a.value);
    fit.shift = target_of(a, kind) - fit.scale * a.value;
    // Also false for NaN.
    if (!(fit.scale > 0) || !std::isfinite(fit.scale)) continue;
    // A narrower limit than that of inliers tells the kinds apart.
    const int64_t inliers = count_inliers(fit, samples, near / 2);
    if (inliers <= most) continue;
    most = inliers;
    best = fit;
  }
  if (most == 0) return std::nullopt;
  for (int k = 0; k < rounds; ++k) best = refined(best, samples);
  std::vector<double> errors;
  for (const DepthSample& sample : samples) {
    if (const double error = relative_error(best, sample); error < near) errors.push_back(error);
  }
  best.inliers = static_cast<double>(errors.size()) / static_cast<double>(samples.size());
  best.error = median(errors);
  if (best.inliers < least_inliers) return std::nullopt;
  // Points that lie nearly at one depth fit any values.
  const double left = misfit(samples, [&](const DepthSample& s) { return best.depth_of(s.value); });
  if (left > most_of_constant * misfit_of_constant(samples, random)) return std::nullopt;
  return best;
}

std::vector<DepthSample> depth_samples(const Capture& capture, const SurfacePoints& points, const View& view,
                                       const Tensor<float>& values) {
  const Camera<float>& camera = view.camera;
  const Lens& lens = capture.images->source(view.id).lens;
  const std::optional<DecodedMask> mask = capture.images->mask(view.id);
  const Vec2<double> scale(static_cast<double>(values.dim(1)) / lens.width,
                           static_cast<double>(values.dim(0)) / lens.height);
  std::vector<DepthSample> samples;
  points.for_each_visible(camera, [&](const Vec2<float>& at, float depth, const Vec3<double>&) {
    if (mask && mask->mask(static_cast<int64_t>(at.y), static_cast<int64_t>(at.x)) != 0) return;
    const Vec2<double> stored = scale * lens.pixel_from_ideal({(at.x - camera.centre_x) / camera.focal_x,
                                                               (at.y - camera.centre_y) / camera.focal_y});
    const auto x = static_cast<int64_t>(std::floor(stored.x)), y = static_cast<int64_t>(std::floor(stored.y));
    if (x < 0 || y < 0 || x >= values.dim(1) || y >= values.dim(0) || !std::isfinite(values(y, x))) return;
    samples.push_back({values(y, x), depth / capture.normalisation.scale});
  });
  return samples;
}

double DepthFits::error() const {
  std::vector<double> errors;
  errors.reserve(of_view.size());
  for (const auto& [id, fit] : of_view) errors.push_back(fit.error);
  return median(errors);
}

DepthFits fit_views(const std::map<std::string, std::vector<DepthSample>>& samples, DepthKind kind) {
  if (kind == DepthKind::automatic) {
    const auto fitting = [&](const DepthFits& fits) {
      double sum = 0;
      for (const auto& [id, fit] : fits.of_view)
        sum += fit.inliers * static_cast<double>(samples.at(id).size()) * (1 - fit.error / near);
      return sum;
    };
    DepthFits inverse = fit_views(samples, DepthKind::inverse), depth = fit_views(samples, DepthKind::depth);
    return fitting(inverse) > fitting(depth) ? inverse : depth;
  }
  DepthFits fits{kind, {}};
  for (const auto& [id, of_view] : samples) {
    if (const std::optional<DepthFit> fit = fit_depths(of_view, kind)) fits.of_view.emplace(id, *fit);
  }
  return fits;
}

}  // namespace traceflow::prepare
