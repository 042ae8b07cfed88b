#include "train/new_surface.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "math/activation.h"
#include "math/rotation.h"
#include "math/rotation_group.h"
#include "math/spherical_harmonics.h"
#include "ops/deform/deform.h"
#include "ops/motion/motion.h"
#include "scene/rows.h"
#include "train/bodies.h"

namespace traceflow {

namespace {

// Shares of a pixel: that the mask covers where surface is missing, that bodies cover there at most, and that
// a body covers where its surface is known.
constexpr float in_mask = 0.95F, uncovered = 0.5F, known = 0.7F;
constexpr int most_rings = 6;
// How far the surface may come nearer or go away from one pixel to the next, as a share of its distance.
constexpr float most_step = 0.05F;
constexpr float least_facing = 0.2F;  // cosine
constexpr float pixels_per_scale = 0.6F, first_opacity = 0.7F;

struct SurfacePoint {
  int32_t body = -1;
  Vec3<float> position{0}, normal{0};  // world
};

// What each pixel of a camera shows of the bodies.
struct SurfaceMap {
  const Camera<float>& camera;
  std::vector<SurfacePoint> points;  // of each pixel

  Vec3<float> ray(int64_t pixel) const {
    const int64_t row = pixel / camera.width, column = pixel % camera.width;
    return camera.ray_in_world(static_cast<float>(column) + 0.5F, static_cast<float>(row) + 0.5F);
  }
};

// Whether the mask covers a pixel and the four around it. A surfel at the mask's edge would stick out, and
// the next time's silhouette would push its body away from the camera.
bool is_inside(const Tensor<float>& coverage, int64_t pixel) {
  const int64_t height = coverage.dim(0), width = coverage.dim(1);
  const int64_t row = pixel / width, column = pixel % width;
  if (row == 0 || column == 0 || row + 1 == height || column + 1 == width) return false;
  return std::min({coverage[pixel], coverage[pixel - 1], coverage[pixel + 1], coverage[pixel - width],
                   coverage[pixel + width]}) >= in_mask;
}

// Draws the bodies alone and fills the map where they cover a pixel: where their surfels are, however much of
// them shows. Returns the pixels inside the mask that no body covers.
std::vector<int64_t> draw_bodies(const TrackTarget& target, const Motion& motion, int64_t key,
                                 const Surfels& surfels, const raster::Options& options, SurfaceMap& map) {
  PosedSurfels posed;
  deform::forward(surfels, nullptr, motion.time[key], {}, 0, field::Precision::fp32, posed, nullptr);
  motion::forward(motion, surfels.body, motion.time[key], {}, posed, *motion::make_saved());
  for (int64_t i = 0; i < surfels.count(); ++i) {
    posed.opacity[i] = surfels.body[i] < 0 ? 0 : solid_opacity;
  }
  posed.tint.resize({surfels.count()});
  const int64_t pixels = target.coverage.size();
  map.points.resize(static_cast<size_t>(pixels));
  std::vector<int64_t> missing;
  raster::Output picture;
  for (int32_t body = 0; body < motion.bodies(); ++body) {
    // The rasteriser's tint is then the share of this body.
    for (int64_t i = 0; i < surfels.count(); ++i) posed.tint[i] = surfels.body[i] == body ? 1.0F : 0.0F;
    raster::forward(posed, map.camera, options, picture, nullptr);
    for (int64_t at = 0; at < pixels; ++at) {
      if (body == 0 && picture.alpha[at] < uncovered && is_inside(target.coverage, at)) missing.push_back(at);
      if (picture.tint[at] < known || target.mask[at] == 0) continue;
      const Vec3<float> normal = load3<float>(&picture.normal[3 * at]);
      if (!(length(normal) > 0)) continue;
      map.points[static_cast<size_t>(at)] = {body, map.camera.position + picture.depth[at] * map.ray(at),
                                             normalize(normal)};
    }
  }
  return missing;
}

// The mean of where the planes of the eight neighbours meet the pixel's ray; body −1 where none does.
SurfacePoint continued(const SurfaceMap& map, const Tensor<float>& normal_prior, int64_t pixel) {
  const int64_t height = map.camera.height, width = map.camera.width;
  const Vec3<float> eye = map.camera.position, ray = map.ray(pixel);
  const Vec3<float> prior = normal_prior.empty() ? Vec3<float>(0) : load3<float>(&normal_prior[3 * pixel]);
  SurfacePoint sum;
  float count = 0;
  const int64_t row = pixel / width, column = pixel % width;
  for (int64_t y = std::max<int64_t>(0, row - 1); y <= std::min(height - 1, row + 1); ++y) {
    for (int64_t x = std::max<int64_t>(0, column - 1); x <= std::min(width - 1, column + 1); ++x) {
      const SurfacePoint& beside = map.points[static_cast<size_t>(y * width + x)];
      if (beside.body < 0 || (sum.body >= 0 && sum.body != beside.body)) continue;
      // The chord from one pixel to the next has the mean of both normals.
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

// Continues the surface ring by ring. Returns the pixels that got a point.
std::vector<int64_t> grow(SurfaceMap& map, const Tensor<float>& normal_prior, std::vector<int64_t> missing) {
  std::vector<int64_t> found;
  for (int ring = 0; ring < most_rings && !missing.empty(); ++ring) {
    std::vector<std::pair<int64_t, SurfacePoint>> next;
    std::vector<int64_t> left;
    for (const int64_t pixel : missing) {
      const SurfacePoint point = continued(map, normal_prior, pixel);
      if (point.body < 0)
        left.push_back(pixel);
      else
        next.emplace_back(pixel, point);
    }
    for (const auto& [pixel, point] : next) {
      map.points[static_cast<size_t>(pixel)] = point;
      found.push_back(pixel);
    }
    missing = std::move(left);
  }
  return found;
}

}  // namespace

Surfels new_surface(const TrackTarget& target, const Motion& motion, int64_t key, const Surfels& surfels,
                    const raster::Options& options, float tint, int64_t limit) {
  SurfaceMap map{target.camera, {}};
  const std::vector<int64_t> missing = draw_bodies(target, motion, key, surfels, options, map);
  std::vector<int64_t> found = grow(map, target.normal_prior, missing);
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
    const SurfacePoint& point = map.points[static_cast<size_t>(pixel)];
    const Mat3<double> back =
        transpose(rotation_from_quaternion(load4<double>(&motion.rotation(point.body, key, 0))));
    const Vec3<double> centre = load3<double>(motion.centre.row(point.body));
    const Vec3<double> arm =
        Vec3<double>(point.position) - centre - load3<double>(&motion.shift(point.body, key, 0));
    store3(made.position.row(k), centre + back * arm);
    const Vec4<double> rotation = quaternion_towards(back * Vec3<double>(point.normal));
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
