#include "capture/checks/view_facts.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/robust.h"
#include "capture/decode.h"
#include "capture/image_cache.h"
#include "capture/lens/resample.h"
#include "capture/noise.h"
#include "capture/sharpness.h"
#include "files/png.h"

namespace traceflow {

namespace {

double variance(const Tensor<uint8_t>& grey) {
  int64_t sum = 0, squares = 0;
  for (const uint8_t v : grey.values()) {
    sum += v;
    squares += int64_t{v} * v;
  }
  const auto count = static_cast<double>(grey.size());
  const double mean = static_cast<double>(sum) / count;
  return static_cast<double>(squares) / count - mean * mean;
}

Tensor<uint8_t> thumbnail_of(const Tensor<uint8_t>& grey) {
  constexpr int64_t widest = 64;
  const int64_t width = std::min(widest, grey.dim(1));
  const double step = static_cast<double>(grey.dim(1)) / static_cast<double>(width);
  const auto height = std::max<int64_t>(1, static_cast<int64_t>(static_cast<double>(grey.dim(0)) / step));
  Tensor<float> values({grey.dim(0), grey.dim(1), 1});
  std::ranges::transform(grey.values(), values.data(), [](uint8_t v) { return from_8bit(v); });
  const Tensor<float> small = resample(values, {width, height, step, step});
  Tensor<uint8_t> result({height, width});
  std::ranges::transform(small.values(), result.data(), [](float v) { return to_8bit(v); });
  return result;
}

void measure_colour(const Tensor<uint8_t>& colour, ViewFacts& facts) {
  constexpr double least_contrast = 1;  // squared 8-bit levels
  int64_t sum = 0;
  for (const uint8_t v : colour.values()) sum += v;
  facts.mean_colour = static_cast<double>(sum) / 255 / static_cast<double>(colour.size());
  facts.is_uniform = std::equal(colour.data() + 3, colour.data() + colour.size(), colour.data());
  const Tensor<uint8_t> grey = grey_of(colour);
  facts.exposure = exposure_of(grey);
  const double contrast = variance(grey);
  if (contrast > least_contrast) facts.sharpness = sharpness(grey) / contrast;
  facts.thumbnail = thumbnail_of(grey);
}

void measure_prior(const Capture& capture, const Tensor<uint8_t>& mask, const SurfacePoints& surface,
                   ViewFacts& facts) {
  constexpr int64_t enough = 30;
  const ViewSource& source = capture.images->source(facts.view->id);
  const CaptureSource& shared = capture.images->capture();
  const Tensor<float> prior = decode_prior(source, shared);
  int64_t known = 0;
  for (int64_t i = 0; i < prior.size(); i += 3) known += load3<float>(&prior[i]) != Vec3<float>(0) ? 1 : 0;
  facts.with_prior = 3 * static_cast<double>(known) / static_cast<double>(prior.size());

  double sum = 0;
  int64_t samples = 0;
  surface.for_each_visible(facts.view->camera, [&](const Vec2<float>& at, float, const Vec3<double>& normal) {
    const auto y = static_cast<int64_t>(at.y), x = static_cast<int64_t>(at.x);
    if (!mask.empty() && mask(y, x) != 0) return;
    const Vec3<double> direction = shared.prior_signs * load3<double>(&prior(y, x, 0));
    if (direction == Vec3<double>(0)) return;
    sum += std::acos(std::clamp(dot(direction, normal), -1.0, 1.0));
    ++samples;
  });
  if (samples >= enough) facts.prior_angle = glm::degrees(sum / static_cast<double>(samples));
}

// Edges of masks are less exact than tracks.
bool is_beside(const Tensor<uint8_t>& mask, const Vec2<float>& at) {
  constexpr int64_t margin = 2;  // pixels
  const auto x = static_cast<int64_t>(std::floor(at.x)), y = static_cast<int64_t>(std::floor(at.y));
  for (int64_t j = std::max<int64_t>(0, y - margin); j <= std::min(mask.dim(0) - 1, y + margin); ++j) {
    for (int64_t i = std::max<int64_t>(0, x - margin); i <= std::min(mask.dim(1) - 1, x + margin); ++i) {
      if (mask(j, i) != 0) return true;
    }
  }
  return false;
}

void measure_tracks(const Capture& capture, const Tensor<uint8_t>& mask, ViewFacts& facts) {
  const PointTracks& tracks = capture.tracks;
  const auto view =
      std::ranges::find_if(capture.train, [&](const View& other) { return &other == facts.view; });
  if (tracks.empty() || mask.empty() || view == capture.train.end()) return;
  const auto row = std::distance(capture.train.begin(), view);
  facts.track_on_mask.resize(static_cast<size_t>(tracks.count()));
  for (int64_t n = 0; n < tracks.count(); ++n) {
    if (tracks.seen(row, n) == 0) continue;
    const Vec3<float> direction(tracks.direction(row, n, 0), tracks.direction(row, n, 1), 1);
    facts.track_on_mask[static_cast<size_t>(n)] = is_beside(mask, view->camera.project(direction)) ? 1 : 0;
  }
}

void measure_depth(const Capture& capture, const Tensor<uint8_t>& mask, const SurfacePoints& surface,
                   ViewFacts& facts) {
  constexpr size_t enough = 30;
  const Tensor<float> prior = decode_depth(capture.images->source(facts.view->id), capture.images->capture());
  const auto known = std::ranges::count_if(prior.values(), [](float z) { return z > 0; });
  facts.with_depth = static_cast<double>(known) / static_cast<double>(prior.size());
  std::vector<double> ratios, errors;
  surface.for_each_visible(facts.view->camera, [&](const Vec2<float>& at, float depth, const Vec3<double>&) {
    const auto y = static_cast<int64_t>(at.y), x = static_cast<int64_t>(at.x);
    if ((!mask.empty() && mask(y, x) != 0) || !(prior(y, x) > 0)) return;
    ratios.push_back(prior(y, x) / depth);
    errors.push_back(std::abs(ratios.back() - 1));
  });
  if (ratios.size() < enough) return;
  facts.depth_scale = median(std::move(ratios));
  facts.depth_error = median(std::move(errors));
}

void measure(const Capture& capture, const SurfacePoints& surface, ViewFacts& facts) {
  const ViewSource& source = capture.images->source(facts.view->id);
  const Tensor<uint8_t> colour = decode_colour(source).colour;
  measure_colour(colour, facts);
  facts.noise = noise_deviation(colour, {});
  Tensor<uint8_t> mask;
  if (source.mask) {
    mask = decode_mask(source).mask;
    facts.masked_noise = noise_deviation(colour, mask);
    const auto on = std::ranges::count(mask.values(), 1);
    facts.masked = static_cast<double>(on) / static_cast<double>(mask.size());
  }
  measure_tracks(capture, mask, facts);
  if (source.has_prior()) measure_prior(capture, mask, surface, facts);
  if (source.depth) measure_depth(capture, mask, surface, facts);
  load_truth(capture, *facts.view);
}

}  // namespace

std::optional<double> exposure_of(const Tensor<uint8_t>& grey) {
  constexpr uint8_t darkest = 8;       // darker pixels are black background or noise
  constexpr int64_t least_share = 50;  // at least one in so many pixels must be brighter
  constexpr double display_gamma = 2.2;
  double sum = 0;
  int64_t count = 0;
  for (const uint8_t v : grey.values()) {
    if (v < darkest) continue;
    sum += std::log2(v / 255.0);
    ++count;
  }
  if (count * least_share < grey.size() || count == 0) return std::nullopt;
  return display_gamma * sum / static_cast<double>(count);
}

ViewFacts measure_view(const Capture& capture, const View& view, const SurfacePoints& surface) {
  ViewFacts facts;
  facts.view = &view;
  try {
    measure(capture, surface, facts);
  } catch (const InputError& error) {
    facts = {};
    facts.view = &view;
    facts.broken = error.what();
  }
  return facts;
}

}  // namespace traceflow
