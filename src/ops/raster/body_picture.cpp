#include "ops/raster/body_picture.h"

#include <algorithm>
#include <vector>

#include "base/parallel.h"
#include "math/rotation.h"
#include "ops/raster/raster_footprint.h"
#include "ops/raster/raster_kernels.h"

namespace traceflow::raster {

namespace {

constexpr int pose_size = 6;
constexpr int channels = 7;  // silhouette, normal, colour

struct SurfelAxes {
  Vec3<float> position, axis_u, axis_v, normal;  // world; the axes over their scales
};

SurfelAxes axes_of(const PosedSurfels& s, int64_t i) {
  const Mat3<float> axes = rotation_from_quaternion(load4<float>(s.rotation.row(i)));
  return {load3<float>(s.position.row(i)), axes[0] / s.scale(i, 0), axes[1] / s.scale(i, 1), axes[2]};
}

// A hit's ρ changes by `slope` · the velocity of the matter at `at`.
struct RhoSlope {
  Vec3<float> at, slope;
};

// u = axis_u · (x − p) with x on the plane: matter that moves by V changes it by −(axis_u − (d·axis_u / d·n)
// n) · V.
RhoSlope plane_slope(const SurfelAxes& f, const Camera<float>& camera, const Vec3<float>& ray,
                     const PixelFootprint& hit, const Splat& splat) {
  const float inverse = 1 / dot(ray, f.normal);
  const Vec3<float> by_u = f.axis_u - (dot(ray, f.axis_u) * inverse) * f.normal;
  const Vec3<float> by_v = f.axis_v - (dot(ray, f.axis_v) * inverse) * f.normal;
  const float u = hit.nu * hit.inverse_w, v = hit.nv * hit.inverse_w;
  return {camera.position + hit.z(splat) * ray, -2.0F * (u * by_u + v * by_v)};
}

// ρ = 2 |x − projected centre|².
RhoSlope screen_slope(const SurfelAxes& f, const Camera<float>& camera, const PixelFootprint& hit) {
  const Vec3<float> centre = camera.point_in_camera(f.position);
  const float gx = -4 * hit.dx * camera.focal_x / centre.z, gy = -4 * hit.dy * camera.focal_y / centre.z;
  const Vec3<float> in_camera(gx, gy, -(gx * centre.x + gy * centre.y) / centre.z);
  return {f.position, in_camera * camera.camera_from_world};
}

class BodyTile {
 public:
  BodyTile(const PosedSurfels& surfels, const Tensor<int32_t>& body, const Tensor<float>& pivot,
           const Camera<float>& camera, const Options& options, const Saved& saved, BodyPicture& picture)
      : surfels_(surfels),
        body_(body),
        pivot_(pivot),
        camera_(camera),
        options_(options),
        saved_(saved),
        picture_(picture),
        params_(pose_size * static_cast<int>(pivot.dim(0))),
        by_transmittance_(static_cast<size_t>(params_)) {}

  void run(int64_t tile) {
    const int64_t x0 = tile % saved_.tile_columns * tile_edge, y0 = tile / saved_.tile_columns * tile_edge;
    const int64_t x1 = std::min<int64_t>(x0 + tile_edge, camera_.width);
    const int64_t y1 = std::min<int64_t>(y0 + tile_edge, camera_.height);
    const auto is_carried = [&](const TileEntry& entry) { return body_[entry.surfel] >= 0; };
    const TileEntry* const begin = saved_.entries.data() + saved_.tile_begin[tile];
    const TileEntry* const end = saved_.entries.data() + saved_.tile_begin[tile + 1];
    if (std::none_of(begin, end, is_carried)) return;
    for (int64_t y = y0; y < y1; y += block_edge) {
      for (int64_t x = x0; x < x1; x += block_edge)
        run_block(tile, x, y, std::min(x + block_edge, x1), std::min(y + block_edge, y1));
    }
  }

 private:
  // What may touch one of the pixels, front to back.
  struct Listed {
    int64_t surfel;
    int32_t body;
    SurfelAxes axes;  // of carried ones
  };

  void run_block(int64_t tile, int64_t x0, int64_t y0, int64_t x1, int64_t y1) {
    listed_.clear();
    for (uint32_t e = saved_.tile_begin[tile]; e < saved_.tile_begin[tile + 1]; ++e) {
      const int64_t surfel = saved_.entries[e].surfel;
      if (!reaches(saved_.splats[surfel], static_cast<float>(x0) + 0.5F, static_cast<float>(y0) + 0.5F,
                   static_cast<float>(x1) - 0.5F, static_cast<float>(y1) - 0.5F))
        continue;
      const int32_t body = body_[surfel];
      listed_.push_back({surfel, body, body >= 0 ? axes_of(surfels_, surfel) : SurfelAxes{}});
    }
    for (int64_t y = y0; y < y1; ++y) {
      for (int64_t x = x0; x < x1; ++x) blend(x, y);
    }
  }

  void blend(int64_t x, int64_t y) {
    const int64_t pixel = y * camera_.width + x;
    const float px = static_cast<float>(x) + 0.5F, py = static_cast<float>(y) + 0.5F;
    const Vec3<float> ray = camera_.ray_in_world(px, py);
    float* const to = picture_.jacobian.data() + pixel * params_ * channels;
    std::fill(by_transmittance_.begin(), by_transmittance_.end(), 0.0F);
    float transmittance = 1, silhouette = 0;
    Vec3<float> normal(0), colour(0);
    bool moves = false;  // what stands before the next hit
    for (const Listed& listed : listed_) {
      const Splat& splat = saved_.splats[listed.surfel];
      const PixelFootprint hit = footprint(splat, px, py);
      if (!hit.inside) continue;
      const float alpha = std::min(hit.opacity, options_.alpha_max);
      const float weight = transmittance * alpha;
      if (transmittance - weight < options_.transmittance_min) break;
      const Vec3<float> n = load3<float>(splat.normal), c = load3<float>(splat.colour);
      const float indicator = listed.body >= 0 ? 1.0F : 0.0F;
      moves = moves || listed.body >= 0;
      if (moves) differentiate(listed, splat, hit, ray, {alpha, weight, indicator, n, c}, to);
      silhouette += weight * indicator;
      normal += weight * n;
      colour += weight * c;
      transmittance -= weight;
    }
    picture_.silhouette[pixel] = silhouette;
    store3(picture_.normal.data() + 3 * pixel, normal);
    store3(picture_.colour.data() + 3 * pixel, colour);
  }

  struct Hit {
    float alpha, weight, indicator;
    Vec3<float> normal, colour;
  };

  void differentiate(const Listed& listed, const Splat& splat, const PixelFootprint& at,
                     const Vec3<float>& ray, const Hit& hit, float* to) {
    const auto add = [&](int p, float by_weight) {
      float* const row = to + p * channels;
      row[0] += by_weight * hit.indicator;
      for (int k = 0; k < 3; ++k) {
        row[1 + k] += by_weight * hit.normal[k];
        row[4 + k] += by_weight * hit.colour[k];
      }
      by_transmittance_[static_cast<size_t>(p)] -= by_weight;
    };
    // What stands before dims this hit.
    for (int p = 0; p < params_; ++p) {
      const float by = by_transmittance_[static_cast<size_t>(p)];
      if (by != 0) add(p, by * hit.alpha);
    }
    if (listed.body < 0) return;
    const int first = pose_size * listed.body;
    if (at.opacity < options_.alpha_max) {
      const RhoSlope rho = at.on_plane ? plane_slope(listed.axes, camera_, ray, at, splat)
                                       : screen_slope(listed.axes, camera_, at);
      const Vec3<float> turn = cross(rho.at - load3<float>(pivot_.row(listed.body)), rho.slope);
      const float by_rho = -0.5F * hit.weight;
      for (int k = 0; k < 3; ++k) {
        add(first + k, by_rho * turn[k]);
        add(first + 3 + k, by_rho * rho.slope[k]);
      }
    }
    for (int axis = 0; axis < 3; ++axis) {
      Vec3<float> about(0);
      about[axis] = 1;
      add3(to + (first + axis) * channels + 1, hit.weight * cross(about, hit.normal));
    }
  }

  const PosedSurfels& surfels_;
  const Tensor<int32_t>& body_;
  const Tensor<float>& pivot_;
  const Camera<float>& camera_;
  const Options& options_;
  const Saved& saved_;
  BodyPicture& picture_;
  int params_;
  std::vector<float> by_transmittance_;
  std::vector<Listed> listed_;
};

}  // namespace

void draw_bodies(const PosedSurfels& surfels, const Tensor<int32_t>& body, const Tensor<float>& pivot,
                 const Camera<float>& camera, const Options& options, BodyPicture& picture) {
  require(surfels.device() == Device::cpu, "bodies are drawn on the CPU", "");
  require(body.size() == surfels.count(), "each posed surfel has a body or none",
          std::to_string(body.size()));
  static thread_local Saved saved;
  prepare(surfels, camera, options, saved);
  bin(SortOrder::centre, saved);
  const Shape image{camera.height, camera.width};
  picture.silhouette.reset(image);
  picture.normal.reset({camera.height, camera.width, 3});
  picture.colour.reset({camera.height, camera.width, 3});
  picture.jacobian.reset({camera.height, camera.width, pose_size * pivot.dim(0), channels});
  const Saved& tiles = saved;
  parallel_blocks("raster: draw bodies", tiles.tiles(), 1, [&](int64_t tile, int64_t) {
    BodyTile(surfels, body, pivot, camera, options, tiles, picture).run(tile);
  });
}

}  // namespace traceflow::raster
