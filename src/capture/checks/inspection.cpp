#include "capture/checks/inspection.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "base/parallel.h"
#include "base/robust.h"
#include "capture/checks/checks.h"
#include "capture/image_cache.h"

namespace traceflow {

namespace {

constexpr int64_t quick_views = 32;

Inspection::Split inspect_split(const Capture& capture, const std::vector<View>& views) {
  Inspection::Split split;
  std::set<float> times;
  for (const View& view : views) {
    const ViewSource& source = capture.images->source(view.id);
    ++split.views;
    split.masks += source.mask ? 1 : 0;
    split.normal_priors += source.has_prior() ? 1 : 0;
    split.depth_priors += source.depth ? 1 : 0;
    split.truth_normals += source.truth_normal ? 1 : 0;
    split.truth_depths += source.truth_depth ? 1 : 0;
    times.insert(view.time);
  }
  split.times = static_cast<int64_t>(times.size());
  if (!times.empty()) {
    split.first_time = *times.begin();
    split.last_time = *times.rbegin();
  }
  return split;
}

void inspect_images(const Capture& capture, Inspection& result) {
  for (const auto* split : {&capture.train, &capture.test}) {
    for (const View& view : *split) {
      const ViewSource& source = capture.images->source(view.id);
      ++result.sizes[{view.camera.width, view.camera.height}];
      result.resampled_views += source.lens.is_pinhole() ? 0 : 1;
      result.largest_zoom = std::max(result.largest_zoom, source.zoom);
      result.decoded_bytes += capture.images->bytes_of(view.id);
    }
  }
  const ViewSource& first = capture.images->source(capture.train.front().id);
  result.image_folder = std::filesystem::path(first.image.path).parent_path().string();
  result.box_factor = first.factor;
}

void inspect_cameras(const Capture& capture, Inspection& result) {
  const Camera<float>& camera = capture.train.front().camera;
  const double left = camera.centre_x / camera.focal_x;
  const double right = (static_cast<double>(camera.width) - camera.centre_x) / camera.focal_x;
  result.field_of_view_degrees = glm::degrees(std::atan(left) + std::atan(right));

  result.camera_low = result.camera_high = Vec3<double>(camera.position);
  double least = 1;
  for (const View& a : capture.train) {
    result.camera_low = min(result.camera_low, Vec3<double>(a.camera.position));
    result.camera_high = max(result.camera_high, Vec3<double>(a.camera.position));
    for (const View& b : capture.train) {
      const Vec3<double> axis_a = Vec3<double>(Vec3<float>(0, 0, 1) * a.camera.camera_from_world);
      const Vec3<double> axis_b = Vec3<double>(Vec3<float>(0, 0, 1) * b.camera.camera_from_world);
      least = std::min(least, dot(axis_a, axis_b));
    }
  }
  result.camera_turn_degrees = glm::degrees(std::acos(std::clamp(least, -1.0, 1.0)));
}

void inspect_points(const Capture& capture, Inspection& result) {
  if (capture.points.empty()) return;
  result.points_low = result.points_high = load3<double>(capture.points.row(0));
  for (int64_t i = 0; i < capture.points.dim(0); ++i) {
    result.points_low = min(result.points_low, load3<double>(capture.points.row(i)));
    result.points_high = max(result.points_high, load3<double>(capture.points.row(i)));
  }
}

void list_missing(const Capture& capture, Inspection& result) {
  if (capture.points.empty()) result.missing.emplace_back("points (surfels start at random)");
  if (!capture.has_masks) result.missing.emplace_back("masks (no figures inside the moving object)");
  if (!capture.has_normal_priors) result.missing.emplace_back("normal priors (the loss on them is left out)");
  if (capture.test.empty()) result.missing.emplace_back("test views (nothing to evaluate on)");
  if (!capture.has_truth) result.missing.emplace_back("truth for normals and depth (no figures for them)");
  if (!(capture.far_plane > 0)) result.missing.emplace_back("near and far planes");
}

// Adds the warnings of loading, except those that the list of missing parts already covers.
void take_warnings(const Capture& capture, Findings& findings) {
  std::ranges::copy_if(capture.warnings, std::back_inserter(findings),
                       [](const Finding& f) { return f.kind != "no-points" && f.kind != "no-test"; });
}

std::vector<const View*> spread(const std::vector<View>& views, int64_t count) {
  std::vector<const View*> chosen;
  const auto size = static_cast<int64_t>(views.size());
  for (int64_t i = 0; i < std::min(count, size); ++i) {
    chosen.push_back(&views[static_cast<size_t>(i * size / std::min(count, size))]);
  }
  return chosen;
}

std::vector<ViewFacts> measure_views(const Capture& capture, bool quick) {
  std::vector<const View*> views;
  for (const auto* split : {&capture.train, &capture.test}) {
    const auto chosen = spread(*split, quick ? quick_views : static_cast<int64_t>(split->size()));
    views.insert(views.end(), chosen.begin(), chosen.end());
  }
  const bool compares = capture.has_normal_priors || capture.has_depth_priors;
  const SurfacePoints surface(compares ? capture.points : Tensor<float>());
  std::vector<ViewFacts> facts(views.size());
  parallel_for(
      "inspect: views", static_cast<int64_t>(views.size()),
      [&](int64_t n) {
        const auto i = static_cast<size_t>(n);
        facts[i] = measure_view(capture, *views[i], surface);
      },
      1);
  return facts;
}

// The existing values, over the views that could be read.
template <class F>
std::vector<double> values_of(const std::vector<ViewFacts>& facts, F&& value) {
  std::vector<double> values;
  for (const ViewFacts& view : facts) {
    const std::optional<double> v = view.broken.empty() ? value(view) : std::nullopt;
    if (v) values.push_back(*v);
  }
  return values;
}

double mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return values.empty() ? 0 : sum / static_cast<double>(values.size());
}

double root_mean_square(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v * v;
  return values.empty() ? 0 : std::sqrt(sum / static_cast<double>(values.size()));
}

Inspection::Pixels sum_up(const std::vector<ViewFacts>& facts) {
  const auto colours = values_of(facts, [](const ViewFacts& v) { return std::optional(v.mean_colour); });
  Inspection::Pixels pixels;
  pixels.views = static_cast<int64_t>(colours.size());
  pixels.mean_colour = mean(colours);
  pixels.masked = mean(values_of(facts, [](const ViewFacts& v) { return v.masked; }));
  pixels.with_prior = mean(values_of(facts, [](const ViewFacts& v) { return v.with_prior; }));
  pixels.noise = root_mean_square(values_of(facts, [](const ViewFacts& v) { return v.noise; }));
  pixels.masked_noise = root_mean_square(values_of(facts, [](const ViewFacts& v) { return v.masked_noise; }));
  pixels.prior_angle = median(values_of(facts, [](const ViewFacts& v) { return v.prior_angle; }));
  pixels.with_depth = mean(values_of(facts, [](const ViewFacts& v) { return v.with_depth; }));
  pixels.depth_error = median(values_of(facts, [](const ViewFacts& v) { return v.depth_error; }));
  pixels.depth_drift = robust_deviation(values_of(facts, [](const ViewFacts& v) { return v.depth_scale; }));
  return pixels;
}

}  // namespace

Inspection inspect(const Capture& capture, bool quick) {
  Inspection result;
  take_warnings(capture, result.findings);
  result.train = inspect_split(capture, capture.train);
  result.test = inspect_split(capture, capture.test);
  inspect_images(capture, result);
  inspect_cameras(capture, result);
  inspect_points(capture, result);
  list_missing(capture, result);

  check_positions(capture, result.findings);
  check_directions(capture, result.findings);
  check_times(capture, result.findings);
  result.sight = check_points(capture, result.findings);

  const std::vector<ViewFacts> facts = measure_views(capture, quick);
  result.pixels = sum_up(facts);
  check_pictures(facts, result.findings);
  if (!quick) check_neighbours(capture, facts, result.findings);
  check_masks(facts, result.findings);
  check_priors(facts, result.findings);
  result.tracks = check_tracks(capture, facts, result.findings);
  check_depths(facts, result.findings);
  std::ranges::stable_sort(result.findings, {}, &Finding::severity);
  return result;
}

}  // namespace traceflow
