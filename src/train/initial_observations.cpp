#include "train/initial_observations.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "scene/neighbours.h"

namespace traceflow {

namespace {

constexpr size_t earliest_count = 8;
// A surfel hides what is more than hiding_widths of its widths behind a square around it. The square extends
// hiding_reach widths to each side, so that scattered surfels leave no holes. Neighbours on a plane do not
// hide each other if it is seen at an angle of at least asin 1.5/8 = 11°.
constexpr float hiding_reach = 1.5F;
constexpr float hiding_widths = 8;
// The largest extent of a square to each side, in pixels.
constexpr float widest_square = 32;

float width_of(const Surfels& s, int64_t i) { return std::exp(s.log_scale(i, 0)); }

// The position of a surfel in a photograph.
struct Place {
  int column = 0, row = 0;
  float z = 0;
  bool in_frame = false;
};

Place place_of(const Surfels& s, int64_t i, const Camera<float>& camera) {
  Place place;
  const Vec3<float> x = camera.point_in_camera(load3<float>(s.position.row(i)));
  if (!(x.z > 0)) return place;
  const Vec2<float> at = camera.project(x);
  place.in_frame = at.x >= 0 && at.y >= 0 && at.x < static_cast<float>(camera.width) &&
                   at.y < static_cast<float>(camera.height);
  if (!place.in_frame) return place;
  place.column = static_cast<int>(at.x);
  place.row = static_cast<int>(at.y);
  place.z = x.z;
  return place;
}

// The depth beyond which surfels are hidden, H×W.
Tensor<float> hiding_depths(const Surfels& s, const Camera<float>& camera) {
  Tensor<float> hidden_from({camera.height, camera.width});
  hidden_from.fill(std::numeric_limits<float>::infinity());
  for (int64_t i = 0; i < s.count(); ++i) {
    const Place place = place_of(s, i, camera);
    if (!place.in_frame) continue;
    const float width = width_of(s, i);
    const float pixels = hiding_reach * width * camera.focal_x / place.z;
    const int half = static_cast<int>(std::min(pixels, widest_square));
    const float from = place.z + hiding_widths * width;
    const int last_row = std::min(camera.height - 1, place.row + half);
    const int last_column = std::min(camera.width - 1, place.column + half);
    for (int row = std::max(0, place.row - half); row <= last_row; ++row) {
      for (int column = std::max(0, place.column - half); column <= last_column; ++column) {
        hidden_from(row, column) = std::min(hidden_from(row, column), from);
      }
    }
  }
  return hidden_from;
}

float median(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Gives unseen surfels the values of the nearest seen surfel.
void fill_unseen(const Surfels& s, InitialObservations& observations) {
  std::vector<int64_t> seen, unseen;
  for (int64_t i = 0; i < s.count(); ++i)
    (observations.any[static_cast<size_t>(i)] ? seen : unseen).push_back(i);
  if (seen.empty() || unseen.empty()) return;
  const auto rows = [&](const std::vector<int64_t>& listed) {
    Tensor<float> points({static_cast<int64_t>(listed.size()), 3});
    for (size_t k = 0; k < listed.size(); ++k) {
      std::copy_n(s.position.row(listed[k]), 3, points.row(static_cast<int64_t>(k)));
    }
    return points;
  };
  const Tensor<int32_t> nearest = nearest_of(rows(seen), rows(unseen));
  for (size_t k = 0; k < unseen.size(); ++k) {
    const int64_t from = seen[static_cast<size_t>(nearest[static_cast<int64_t>(k)])];
    std::copy_n(observations.colour.row(from), 3, observations.colour.row(unseen[k]));
    observations.outside[static_cast<size_t>(unseen[k])] = observations.outside[static_cast<size_t>(from)];
    observations.any[static_cast<size_t>(unseen[k])] = 1;
  }
}

}  // namespace

// A share of the image's longer side.
constexpr float view_margin = 0.1F;

Tensor<float> points_in_view(const Tensor<float>& points, const std::vector<View>& views, float near_plane) {
  std::vector<uint8_t> is_seen(static_cast<size_t>(points.dim(0)));
  parallel_for("initialise: points in view", points.dim(0), [&](int64_t i) {
    const Vec3<float> point = load3<float>(points.row(i));
    is_seen[static_cast<size_t>(i)] = std::any_of(views.begin(), views.end(), [&](const View& view) {
      const Camera<float>& camera = view.camera;
      return camera.sees(point, near_plane,
                         view_margin * static_cast<float>(std::max(camera.width, camera.height)));
    });
  });
  Tensor<float> seen({std::count(is_seen.begin(), is_seen.end(), uint8_t{1}), 3});
  int64_t taken = 0;
  for (int64_t i = 0; i < points.dim(0); ++i) {
    if (is_seen[static_cast<size_t>(i)] != 0) std::copy_n(points.row(i), 3, seen.row(taken++));
  }
  return seen;
}

std::vector<Photograph> earliest_photographs(const Capture& capture) {
  std::vector<const View*> views;
  for (const View& view : capture.train) views.push_back(&view);
  std::stable_sort(views.begin(), views.end(),
                   [](const View* a, const View* b) { return a->time < b->time; });
  views.resize(std::min(views.size(), earliest_count));
  std::vector<Photograph> photographs;
  photographs.reserve(views.size());
  for (const View* view : views) photographs.push_back({view->camera, load_images(capture, *view)});
  return photographs;
}

InitialObservations observe(const Surfels& surfels, std::span<const Photograph> photographs) {
  const int64_t count = surfels.count();
  const auto n = static_cast<size_t>(count);
  InitialObservations observations{Tensor<float>({count, 3}), std::vector<int>(n, 0),
                                   std::vector<uint8_t>(n, 0)};
  std::vector<Tensor<float>> hidden_from;
  hidden_from.reserve(photographs.size());
  for (const Photograph& photograph : photographs) {
    hidden_from.push_back(hiding_depths(surfels, photograph.camera));
  }
  parallel_for("initialise: look at photographs", count, [&](int64_t i) {
    const auto k = static_cast<size_t>(i);
    std::array<std::vector<float>, 3> colours;
    for (size_t v = 0; v < photographs.size(); ++v) {
      const Place at = place_of(surfels, i, photographs[v].camera);
      if (!at.in_frame || at.z > hidden_from[v](at.row, at.column)) continue;
      const ViewImages& images = *photographs[v].images;
      if (!images.known.empty() && images.known(at.row, at.column) == 0) continue;
      observations.any[k] = 1;
      if (!images.mask.empty()) observations.outside[k] += images.mask(at.row, at.column) != 0 ? -1 : 1;
      for (size_t c = 0; c < 3; ++c) {
        colours[c].push_back(images.colour(at.row, at.column, static_cast<int64_t>(c)));
      }
    }
    if (!observations.any[k]) return;
    for (size_t c = 0; c < 3; ++c) observations.colour(i, static_cast<int64_t>(c)) = median(colours[c]);
  });
  fill_unseen(surfels, observations);
  return observations;
}

}  // namespace traceflow
