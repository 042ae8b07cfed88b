#include "track/new_surface.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "math/activation.h"
#include "math/rotation_group.h"
#include "math/spherical_harmonics.h"
#include "scene/rows.h"
#include "track/body_surface.h"

namespace traceflow {

namespace {

// Shares of a pixel: the least that the mask covers and the most that bodies cover where surface is missing.
constexpr float in_mask = 0.95F, uncovered = 0.5F;
constexpr int most_rings = 6;
// The largest change of distance between neighbouring pixels, as a share of the distance.
constexpr float most_step = 0.05F;
constexpr float least_facing = 0.2F;  // cosine
constexpr float pixels_per_scale = 0.6F, first_opacity = 0.7F;

// Whether the mask covers a pixel and its four neighbours. A surfel at the mask's edge would stick out, and
// the next key's silhouette would push its body away from the camera.
bool is_inside(const Tensor<float>& coverage, int64_t pixel) {
  const int64_t height = coverage.dim(0), width = coverage.dim(1);
  const int64_t row = pixel / width, column = pixel % width;
  if (row == 0 || column == 0 || row + 1 == height || column + 1 == width) return false;
  return std::min({coverage[pixel], coverage[pixel - 1], coverage[pixel + 1], coverage[pixel - width],
                   coverage[pixel + width]}) >= in_mask;
}

// The pixels inside the mask that no body covers. Removes points outside the mask from the surface.
std::vector<int64_t> missing_pixels(const TrackTarget& target, BodySurface& surface) {
  std::vector<int64_t> missing;
  for (int64_t at = 0; at < target.coverage.size(); ++at) {
    if (surface.alpha[at] < uncovered && is_inside(target.coverage, at)) missing.push_back(at);
    if (target.mask[at] == 0) surface.points[static_cast<size_t>(at)] = {};
  }
  return missing;
}

// The mean of the points where the planes of the eight neighbours meet the pixel's ray; body −1 if there are
// none.
SurfacePoint continued(const BodySurface& surface, const Tensor<float>& normal_prior, int64_t pixel) {
  const int64_t height = surface.camera.height, width = surface.camera.width;
  const Vec3<float> eye = surface.camera.position, ray = surface.ray(pixel);
  const Vec3<float> prior = normal_prior.empty() ? Vec3<float>(0) : load3<float>(&normal_prior[3 * pixel]);
  SurfacePoint sum;
  float count = 0;
  const int64_t row = pixel / width, column = pixel % width;
  for (int64_t y = std::max<int64_t>(0, row - 1); y <= std::min(height - 1, row + 1); ++y) {
    for (int64_t x = std::max<int64_t>(0, column - 1); x <= std::min(width - 1, column + 1); ++x) {
      const SurfacePoint& beside = surface.points[static_cast<size_t>(y * width + x)];
      if (beside.body < 0 || (sum.body >= 0 && sum.body != beside.body)) continue;
      // The chord between the two pixels has the mean of both normals.
      const Vec3<float> normal = normalize(beside.normal + prior);
      const float cosine = dot(normal, ray) / length(ray);
      if (!(-cosine > least_facing)) continue;
      const float away = dot(normal, beside.position - eye) / dot(normal, ray);
      const float before = dot(beside.position - eye, ray) / dot(ray, ray);
      if (!(std::abs(away - before) < most_step * before)) continue;
      sum.body = beside.body;
      sum.position += eye + away * ray;
      sum.normal += length(prior) > 0 ? prior : beside.normal;
      ++count;
    }
  }
  if (count == 0) return {};
  return {sum.body, sum.position / count, normalize(sum.normal)};
}

// Continues the surface ring by ring. Returns the pixels with a new point.
std::vector<int64_t> grow(BodySurface& surface, const Tensor<float>& normal_prior,
                          std::vector<int64_t> missing) {
  std::vector<int64_t> found;
  for (int ring = 0; ring < most_rings && !missing.empty(); ++ring) {
    std::vector<std::pair<int64_t, SurfacePoint>> next;
    std::vector<int64_t> left;
    for (const int64_t pixel : missing) {
      const SurfacePoint point = continued(surface, normal_prior, pixel);
      if (point.body < 0)
        left.push_back(pixel);
      else
        next.emplace_back(pixel, point);
    }
    for (const auto& [pixel, point] : next) {
      surface.points[static_cast<size_t>(pixel)] = point;
      found.push_back(pixel);
    }
    missing = std::move(left);
  }
  return found;
}

}  // namespace

Surfels new_surface(const TrackTarget& target, const Motion& motion, int64_t key, const Surfels& surfels,
                    const raster::Options& options, float tint, int64_t limit) {
  BodySurface surface = draw_bodies(target.camera, motion, key, surfels, options);
  std::vector<int64_t> found = grow(surface, target.normal_prior, missing_pixels(target, surface));
  if (static_cast<int64_t>(found.size()) > limit)
    found.resize(static_cast<size_t>(std::max<int64_t>(0, limit)));
  RowEdit copies;
  for (size_t k = 0; k < found.size(); ++k) copies.add(0);
  if (found.empty()) return {};
  Surfels made = edited_rows(surfels, PlacedEdit(copies, Device::cpu));
  made.sh.zero();
  made.opacity_logit.fill(logit(first_opacity));
  if (made.has_tint()) made.tint_logit.fill(logit(tint));
  for (int64_t k = 0; k < made.count(); ++k) {
    const int64_t pixel = found[static_cast<size_t>(k)];
    const SurfacePoint& point = surface.points[static_cast<size_t>(pixel)];
    const SurfacePoint rest = at_rest(point, motion, key);
    store3(made.position.row(k), Vec3<double>(rest.position));
    const Vec4<double> rotation = quaternion_towards(Vec3<double>(rest.normal));
    for (int c = 0; c < 4; ++c) made.rotation(k, c) = static_cast<float>(rotation[c]);
    const float pixel_size = length(point.position - target.camera.position) / target.camera.focal_x;
    made.log_scale(k, 0) = made.log_scale(k, 1) = std::log(pixels_per_scale * pixel_size);
    for (int64_t c = 0; c < 3; ++c)
      made.sh(k, 0, c) = (target.colour[3 * pixel + c] - 0.5F) / static_cast<float>(sh_c0);
    made.body[k] = point.body;
  }
  return made;
}

}  // namespace traceflow
