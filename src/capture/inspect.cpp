#include "capture/inspect.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>

#include "base/error.h"
#include "base/parallel.h"
#include "capture/image_cache.h"

namespace traceflow {

namespace {

constexpr double degrees = 180 / std::numbers::pi;

Inspection::Split inspect_split(const Capture& capture, const std::vector<View>& views) {
  Inspection::Split split;
  std::set<float> times;
  for (const View& view : views) {
    const ViewSource& source = capture.images->source(view.id);
    ++split.views;
    split.masks += source.mask ? 1 : 0;
    split.normal_priors += source.has_prior() ? 1 : 0;
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

void inspect_cameras(const Capture& capture, Inspection& result) {
  for (const auto* split : {&capture.train, &capture.test}) {
    for (const View& view : *split) {
      const ViewSource& source = capture.images->source(view.id);
      ++result.sizes[{view.camera.width, view.camera.height}];
      result.resampled_views += source.lens.is_pinhole() ? 0 : 1;
      result.largest_zoom = std::max(result.largest_zoom, source.zoom);
    }
  }
  const ViewSource& first = capture.images->source(capture.train.front().id);
  result.image_folder = std::filesystem::path(first.image.path).parent_path().string();
  result.box_factor = first.factor;
  const Camera<float>& camera = capture.train.front().camera;
  const double left = camera.centre_x / camera.focal_x;
  const double right = (static_cast<double>(camera.width) - camera.centre_x) / camera.focal_x;
  result.field_of_view_degrees = (std::atan(left) + std::atan(right)) * degrees;

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
  result.camera_turn_degrees = std::acos(std::clamp(least, -1.0, 1.0)) * degrees;
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
  if (!(capture.far_plane > 0)) result.missing.emplace_back("near and far in scene.json");
}

std::vector<const View*> spread(const std::vector<View>& views, int64_t count) {
  std::vector<const View*> chosen;
  const auto size = static_cast<int64_t>(views.size());
  for (int64_t i = 0; i < std::min(count, size); ++i) {
    chosen.push_back(&views[static_cast<size_t>(i * size / std::min(count, size))]);
  }
  return chosen;
}

// What one view's pixels show.
struct ViewPixels {
  double mean_colour = 0;
  bool is_uniform = true;
  std::optional<double> masked, with_prior;
  std::string broken;
};

ViewPixels inspect_view(const Capture& capture, const View& view) {
  ViewPixels result;
  try {
    const auto images = load_images(capture, view);
    double sum = 0;
    for (const float v : images->colour.values()) {
      sum += v;
      result.is_uniform &= v == images->colour[0];
    }
    result.mean_colour = sum / static_cast<double>(images->colour.size());
    if (!images->mask.empty()) {
      const auto on = std::count(images->mask.data(), images->mask.data() + images->mask.size(), uint8_t{1});
      result.masked = static_cast<double>(on) / static_cast<double>(images->mask.size());
    }
    if (!images->normal_prior.empty()) {
      int64_t known = 0;
      for (int64_t i = 0; i < images->normal_prior.size(); i += 3) {
        known += load3<float>(&images->normal_prior[i]) != Vec3<float>(0) ? 1 : 0;
      }
      result.with_prior = 3 * static_cast<double>(known) / static_cast<double>(images->normal_prior.size());
    }
    load_truth(capture, view);
  } catch (const InputError& error) {
    result.broken = error.what();
  }
  return result;
}

// Mean of the values that exist, 0 where none does.
template <class F>
double mean_of(const std::vector<ViewPixels>& views, F&& value) {
  double sum = 0;
  int64_t count = 0;
  for (const ViewPixels& view : views) {
    const std::optional<double> v = view.broken.empty() ? value(view) : std::nullopt;
    if (!v) continue;
    sum += *v;
    ++count;
  }
  return count > 0 ? sum / static_cast<double>(count) : 0;
}

void inspect_pixels(const Capture& capture, int64_t count, Inspection& result) {
  std::vector<const View*> views = spread(capture.train, count);
  for (const View* view : spread(capture.test, count)) views.push_back(view);
  std::vector<ViewPixels> pixels(views.size());
  parallel_for(
      "inspect: views", static_cast<int64_t>(views.size()),
      [&](int64_t i) {
        pixels[static_cast<size_t>(i)] = inspect_view(capture, *views[static_cast<size_t>(i)]);
      },
      1);

  int64_t uniform = 0;
  for (const ViewPixels& view : pixels) {
    if (!view.broken.empty()) result.warnings.push_back(view.broken);
    uniform += view.broken.empty() && view.is_uniform ? 1 : 0;
    result.pixels.views += view.broken.empty() ? 1 : 0;
  }
  result.pixels.mean_colour =
      mean_of(pixels, [](const ViewPixels& v) { return std::optional(v.mean_colour); });
  result.pixels.masked = mean_of(pixels, [](const ViewPixels& v) { return v.masked; });
  result.pixels.with_prior = mean_of(pixels, [](const ViewPixels& v) { return v.with_prior; });
  if (uniform > 0)
    result.warnings.push_back(std::to_string(uniform) + " of the decoded views are of one colour");
  if (capture.has_masks && result.pixels.masked > 0.6) {
    result.warnings.emplace_back(
        "the masks cover most of the image: mask/ has the object white, resized_mask/ black; are they the "
        "other way round?");
  }
  if (capture.has_masks && result.pixels.views > 0 && result.pixels.masked == 0) {
    result.warnings.emplace_back("the masks are empty");
  }
  if (capture.has_normal_priors && result.pixels.with_prior < 0.1) {
    result.warnings.emplace_back("the normal priors are almost empty");
  }
}

}  // namespace

Inspection inspect(const Capture& capture, int64_t views_to_decode) {
  Inspection result;
  result.warnings = capture.warnings;
  result.train = inspect_split(capture, capture.train);
  result.test = inspect_split(capture, capture.test);
  inspect_cameras(capture, result);
  inspect_points(capture, result);
  list_missing(capture, result);
  inspect_pixels(capture, views_to_decode, result);
  return result;
}

}  // namespace traceflow
