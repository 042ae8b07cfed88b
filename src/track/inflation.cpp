#include "track/inflation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>

#include "base/parallel.h"

namespace traceflow {

namespace {

Vec2<float> pixel_centre(int64_t pixel, int64_t width) {
  const int64_t row = pixel / width, column = pixel % width;
  return {static_cast<float>(column) + 0.5F, static_cast<float>(row) + 0.5F};
}

// The part's pixels with a neighbour outside the part. The image border does not count.
std::vector<Vec2<float>> outline_of(const std::vector<int64_t>& part, const Camera<float>& camera) {
  const int64_t height = camera.height, width = camera.width;
  Tensor<uint8_t> mask({height, width});
  for (const int64_t pixel : part) mask[pixel] = 1;
  std::vector<Vec2<float>> outline;
  for (const int64_t pixel : part) {
    const int64_t row = pixel / width, column = pixel % width;
    const bool is_inside = (row == 0 || mask[pixel - width] != 0) && (column == 0 || mask[pixel - 1] != 0) &&
                           (row + 1 == height || mask[pixel + width] != 0) &&
                           (column + 1 == width || mask[pixel + 1] != 0);
    if (!is_inside) outline.push_back(pixel_centre(pixel, width));
  }
  return outline;
}

float distance_to(const std::vector<Vec2<float>>& outline, const Vec2<float>& at) {
  float nearest2 = std::numeric_limits<float>::infinity();
  for (const Vec2<float>& p : outline) nearest2 = std::min(nearest2, dot(p - at, p - at));
  return std::sqrt(nearest2);
}

// Every `step`th pixel of every `step`th row, so that about `most` remain.
std::vector<int64_t> thinned(const std::vector<int64_t>& part, int64_t width, int64_t most) {
  const auto count = static_cast<double>(part.size());
  const auto step = static_cast<int64_t>(std::ceil(std::sqrt(count / static_cast<double>(most))));
  std::vector<int64_t> kept;
  std::ranges::copy_if(part, std::back_inserter(kept),
                       [&](int64_t pixel) { return pixel / width % step == 0 && pixel % width % step == 0; });
  return kept;
}

// The place itself, or, nearer than `margin` to the outline, one at this distance from it: towards the mean
// of the part's pixels around the place. inside: H×W, 1 for the part's pixels.
Vec2<float> pushed_inwards(const Tensor<uint8_t>& inside, const std::vector<Vec2<float>>& outline,
                           const Vec2<float>& at, float margin) {
  const float distance = outline.empty() ? margin : distance_to(outline, at);
  if (distance >= margin) return at;
  const auto radius = static_cast<int64_t>(std::ceil(3 * margin));
  const auto row = static_cast<int64_t>(at.y), column = static_cast<int64_t>(at.x);
  Vec2<float> inwards(0);
  for (int64_t y = std::max<int64_t>(0, row - radius); y <= std::min(inside.dim(0) - 1, row + radius); ++y) {
    for (int64_t x = std::max<int64_t>(0, column - radius); x <= std::min(inside.dim(1) - 1, column + radius);
         ++x) {
      if (inside(y, x) != 0) inwards += pixel_centre(y * inside.dim(1) + x, inside.dim(1)) - at;
    }
  }
  const float size = length(inwards);
  return size > 0 ? at + ((margin - distance) / size) * inwards : at;
}

// What the prior's depths are multiplied with so that they fit the points beside the part: a prior's errors
// vary slowly over the image. Nothing if there are too few points, or the prior has no depth there.
std::optional<float> scale_beside(const std::vector<int64_t>& part, const Tensor<uint8_t>& mask,
                                  const Camera<float>& camera, const Tensor<float>& depth,
                                  const Tensor<float>& points) {
  constexpr float largest_change = 1.3F;
  constexpr size_t enough = 8;
  if (depth.empty()) return std::nullopt;
  const std::vector<Vec2<float>> outline = outline_of(part, camera);
  const float farthest = 0.5F * std::sqrt(static_cast<float>(part.size()));
  std::vector<float> ratios;
  for (int64_t i = 0; i < points.dim(0); ++i) {
    const Vec3<float> point = load3<float>(points.row(i));
    if (!camera.sees(point)) continue;
    const Vec3<float> in_camera = camera.point_in_camera(point);
    const Vec2<float> at = camera.project(in_camera);
    const auto row = static_cast<int64_t>(at.y), column = static_cast<int64_t>(at.x);
    if (mask(row, column) != 0 || !(depth(row, column) > 0) || distance_to(outline, at) > farthest) continue;
    // Farther points are hidden, or the prior is of something else.
    const float ratio = in_camera.z / depth(row, column);
    if (ratio < largest_change && ratio > 1 / largest_change) ratios.push_back(ratio);
  }
  if (ratios.size() < enough) return std::nullopt;
  const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
  std::nth_element(ratios.begin(), middle, ratios.end());
  return *middle;
}

Tensor<float> tensor_of_points(const std::vector<Vec3<float>>& points) {
  Tensor<float> result({static_cast<int64_t>(points.size()), 3});
  for (size_t k = 0; k < points.size(); ++k) store3(result.row(static_cast<int64_t>(k)), points[k]);
  return result;
}

}  // namespace

std::optional<float> depth_beside(const std::vector<int64_t>& part, const Tensor<uint8_t>& mask,
                                  const Camera<float>& camera, const Tensor<float>& points) {
  constexpr float max_distance = 0.5F;  // of the part's size
  constexpr size_t beside = 8, as_near = 2, share = 10;
  const std::vector<Vec2<float>> outline = outline_of(part, camera);
  struct Seen {
    Vec2<float> at;
    float depth;
  };
  std::vector<Seen> seen;
  for (int64_t i = 0; i < points.dim(0); ++i) {
    const Vec3<float> point = load3<float>(points.row(i));
    if (!camera.sees(point)) continue;
    const Vec3<float> in_camera = camera.point_in_camera(point);
    const Vec2<float> at = camera.project(in_camera);
    if (mask(static_cast<int64_t>(at.y), static_cast<int64_t>(at.x)) == 0) seen.push_back({at, in_camera.z});
  }
  const float farthest2 = max_distance * max_distance * static_cast<float>(part.size());
  std::vector<float> depths;
  for (const Vec2<float>& pixel : outline) {
    if (seen.size() < beside) break;
    const auto distance2 = [&](const Seen& point) { return dot(point.at - pixel, point.at - pixel); };
    const auto last = seen.begin() + beside - 1;
    std::nth_element(seen.begin(), last, seen.end(),
                     [&](const Seen& a, const Seen& b) { return distance2(a) < distance2(b); });
    if (distance2(*last) > farthest2) continue;
    std::array<float, beside> near{};
    std::transform(seen.begin(), seen.begin() + beside, near.begin(), [](const Seen& p) { return p.depth; });
    std::nth_element(near.begin(), near.begin() + as_near - 1, near.end());
    depths.push_back(near[as_near - 1]);
  }
  if (depths.empty()) return std::nullopt;
  const auto near = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / share);
  std::nth_element(depths.begin(), near, depths.end());
  return *near;
}

Tensor<float> inflated(const std::vector<int64_t>& part, const Camera<float>& camera, float depth,
                       int64_t most) {
  const std::vector<Vec2<float>> outline = outline_of(part, camera);
  const auto inwards_at = [&](int64_t pixel) {
    return outline.empty() ? 0 : distance_to(outline, pixel_centre(pixel, camera.width));
  };
  std::vector<float> inwards(part.size());
  parallel_for("inflation", static_cast<int64_t>(part.size()), [&](int64_t k) {
    inwards[static_cast<size_t>(k)] = inwards_at(part[static_cast<size_t>(k)]);
  });
  const float radius = *std::max_element(inwards.begin(), inwards.end());
  std::vector<Vec3<float>> made;
  for (const int64_t pixel : thinned(part, camera.width, most)) {
    const Vec2<float> at = pixel_centre(pixel, camera.width);
    const float inside = inwards_at(pixel);
    const float height = std::sqrt(inside * (2 * radius - inside)) / camera.focal_x;
    made.push_back(camera.position + depth * (1 - height) * camera.ray_in_world(at.x, at.y));
  }
  return tensor_of_points(made);
}

Tensor<float> at_depths(const std::vector<int64_t>& part, const Tensor<uint8_t>& mask,
                        const Camera<float>& camera, const Tensor<float>& depth, const Tensor<float>& points,
                        int64_t most) {
  std::vector<Vec3<float>> made;
  const std::optional<float> scale = scale_beside(part, mask, camera, depth, points);
  if (!scale) return tensor_of_points(made);
  const std::vector<Vec2<float>> outline = outline_of(part, camera);
  // As wide as the blur of an estimator.
  const float margin = std::max(2.5F, static_cast<float>(camera.width) / 120);
  Tensor<uint8_t> inside({camera.height, camera.width});
  for (const int64_t pixel : part) inside[pixel] = 1;
  for (const int64_t pixel : thinned(part, camera.width, most)) {
    const Vec2<float> at = pixel_centre(pixel, camera.width);
    const Vec2<float> from = pushed_inwards(inside, outline, at, margin);
    const auto row = static_cast<int64_t>(std::floor(from.y)),
               column = static_cast<int64_t>(std::floor(from.x));
    if (row < 0 || column < 0 || row >= camera.height || column >= camera.width) continue;
    if (inside(row, column) == 0 || !(depth(row, column) > 0)) continue;
    made.push_back(camera.position + *scale * depth(row, column) * camera.ray_in_world(at.x, at.y));
  }
  return tensor_of_points(made);
}

}  // namespace traceflow
