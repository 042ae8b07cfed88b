#include "ops/raster/body_jacobian.h"

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "math/rotation.h"
#include "ops/raster/raster_kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "ops/raster/cpu/body_jacobian.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "ops/raster/cpu/simd-inl.h"

// For each block, vectors of pixels find where the splats are hit. Then each pixel sums its own hits.
HWY_BEFORE_NAMESPACE();
namespace traceflow::raster::HWY_NAMESPACE {

constexpr int pose_size = 6;
constexpr int channels = 7;  // tint, normal, colour
// Padded by one to whole vectors.
using Values = std::array<float, channels + 1>;
using ByPose = std::array<Values, pose_size>;

struct SurfelAxes {
  Vec3<float> position, axis_u, axis_v, normal;  // world; the axes are divided by their scales
};

inline SurfelAxes axes_of(const PosedSurfels& s, int64_t i) {
  const Mat3<float> axes = rotation_from_quaternion(load4<float>(s.rotation.row(i)));
  return {load3<float>(s.position.row(i)), axes[0] / s.scale(i, 0), axes[1] / s.scale(i, 1), axes[2]};
}

// A splat at the pixels of a block.
struct BlockFootprint {
  alignas(64) float opacity[pixels_per_block];
  alignas(64) float inverse_w[pixels_per_block];
  alignas(64) float nu[pixels_per_block], nv[pixels_per_block];
  alignas(64) float dx[pixels_per_block], dy[pixels_per_block];
  uint32_t inside, on_plane;  // one bit per pixel
};

template <class D>
HWY_INLINE uint32_t bits_of(D d, M<D> mask) {
  uint8_t bits[8] = {};
  hn::StoreMaskBits(d, mask, bits);
  return uint32_t{bits[0]} | uint32_t{bits[1]} << 8;
}

HWY_INLINE void evaluate_block(const Splat& splat, float rho_per_pixel2, int x, int y, BlockFootprint& to) {
  const Pixels d;
  to.inside = to.on_plane = 0;
  for (size_t lane = 0; lane < pixels_per_block; lane += hn::Lanes(d)) {
    const auto f = evaluate(d, rho_per_pixel2, splat, pixel_centres(d, x, y, lane));
    hn::StoreU(f.opacity, d, to.opacity + lane);
    hn::StoreU(f.inverse_w, d, to.inverse_w + lane);
    hn::StoreU(f.nu, d, to.nu + lane);
    hn::StoreU(f.nv, d, to.nv + lane);
    hn::StoreU(f.dx, d, to.dx + lane);
    hn::StoreU(f.dy, d, to.dy + lane);
    to.inside |= bits_of(d, f.inside) << lane;
    to.on_plane |= bits_of(d, f.on_plane) << lane;
  }
}

// The derivative of a hit's ρ is `slope` · the velocity of the surfel's material at the point `at`.
struct RhoSlope {
  Vec3<float> at, slope;
};

// u = axis_u · (x − p) with x on the plane. If the material moves with velocity V, u changes by −(axis_u −
// (d·axis_u / d·n) n) · V.
inline RhoSlope plane_slope(const SurfelAxes& f, const Camera<float>& camera, const Vec3<float>& ray,
                            const BlockFootprint& at, int pixel, const Splat& splat) {
  const float inverse = 1 / dot(ray, f.normal);
  const Vec3<float> by_u = f.axis_u - (dot(ray, f.axis_u) * inverse) * f.normal;
  const Vec3<float> by_v = f.axis_v - (dot(ray, f.axis_v) * inverse) * f.normal;
  const float inverse_w = at.inverse_w[pixel], u = at.nu[pixel] * inverse_w, v = at.nv[pixel] * inverse_w;
  return {camera.position + (splat.z_plane * inverse_w) * ray, -2.0F * (u * by_u + v * by_v)};
}

// ρ = rho_per_pixel2 |x − projected centre|².
inline RhoSlope screen_slope(const SurfelAxes& f, const Camera<float>& camera, const BlockFootprint& at,
                             int pixel, float rho_per_pixel2) {
  const Vec3<float> centre = camera.point_in_camera(f.position);
  const float slope = -2 * rho_per_pixel2;
  const float gx = slope * at.dx[pixel] * camera.focal_x / centre.z;
  const float gy = slope * at.dy[pixel] * camera.focal_y / centre.z;
  const Vec3<float> in_camera(gx, gy, -(gx * centre.x + gy * centre.y) / centre.z);
  return {f.position, in_camera * camera.camera_from_world};
}

// Processes one tile at a time and reuses its memory.
class BodyTile {
 public:
  BodyTile(const PosedSurfels& surfels, const Tensor<int32_t>& body, const Tensor<float>& pivot,
           const Camera<float>& camera, const Options& options, const Saved& saved, Tensor<float>& jacobian)
      : surfels_(surfels),
        body_(body),
        pivot_(pivot),
        camera_(camera),
        options_(options),
        saved_(saved),
        jacobian_(jacobian),
        sums_(static_cast<size_t>(pivot.dim(0))) {}

  void run(int64_t tile) {
    const TileLists tile_of = tile_entries(saved_, tile);
    for (int block = 0; block < blocks_per_tile; ++block) {
      if ((tile_of.blocks >> block & 1) == 0) continue;
      const int left = tile_of.block_x(block), top = tile_of.block_y(block);
      if (!list(tile_of, block, left, top)) continue;
      for (int pixel = 0; pixel < pixels_per_block; ++pixel) {
        const int x = left + pixel % block_edge, y = top + pixel / block_edge;
        if (x < saved_.width && y < saved_.height) differentiate(x, y, pixel);
      }
    }
  }

 private:
  // A splat that forward blended into a pixel of the block. The list is front to back.
  struct Listed {
    const Splat* splat;
    int32_t body;
    SurfelAxes axes;  // only if body ≥ 0
    Values values;
    BlockFootprint at;
  };

  // Returns false if no surfel in the block belongs to a body.
  bool list(const TileLists& tile, int block, int left, int top) {
    listed_.clear();
    const auto touches = [&](const TileEntry& entry) {
      return (saved_.touched[entry.entry] >> block & 1) != 0;
    };
    const auto is_carried = [&](const TileEntry& entry) {
      return touches(entry) && body_[entry.surfel] >= 0;
    };
    if (std::none_of(tile.entries, tile.entries + tile.count, is_carried)) return false;
    for (const TileEntry* entry = tile.entries; entry != tile.entries + tile.count; ++entry) {
      if (!touches(*entry)) continue;
      Listed& listed = listed_.emplace_back();
      const Splat& s = saved_.splats[entry->surfel];
      listed.splat = &s;
      listed.body = body_[entry->surfel];
      if (listed.body >= 0) listed.axes = axes_of(surfels_, entry->surfel);
      listed.values = {s.tint,      s.normal[0], s.normal[1], s.normal[2],
                       s.colour[0], s.colour[1], s.colour[2], 0};
      evaluate_block(s, saved_.rho_per_pixel2, left, top, listed.at);
    }
    return true;
  }

  struct Hit {
    const Listed* listed;
    float alpha, weight;
  };

  // pixel: index in its block.
  void differentiate(int x, int y, int pixel) {
    hits_.clear();
    Values behind{};  // first the blended values of all hits, then of those behind the current hit
    float transmittance = 1;
    for (const Listed& listed : listed_) {
      if ((listed.at.inside >> pixel & 1) == 0) continue;
      const float alpha = std::min(listed.at.opacity[pixel], options_.alpha_max);
      const float weight = transmittance * alpha;
      if (transmittance - weight < options_.transmittance_min) break;
      hits_.push_back({&listed, alpha, weight});
      for (size_t c = 0; c < behind.size(); ++c) behind[c] += weight * listed.values[c];
      transmittance -= weight;
    }
    for (int c = 0; c < 3; ++c) behind[static_cast<size_t>(4 + c)] += transmittance * options_.background[c];

    const Vec3<float> ray = camera_.ray_in_world(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F);
    std::fill(sums_.begin(), sums_.end(), ByPose{});
    for (const Hit& hit : hits_) {
      for (size_t c = 0; c < behind.size(); ++c) behind[c] -= hit.weight * hit.listed->values[c];
      if (hit.listed->body >= 0) add(hit, pixel, behind, ray, sums_[static_cast<size_t>(hit.listed->body)]);
    }
    float* to = jacobian_.row(y) + x * static_cast<int64_t>(sums_.size()) * pose_size * channels;
    for (const ByPose& of_body : sums_) {
      for (const Values& values : of_body) to = std::copy_n(values.data(), channels, to);
    }
  }

  void add(const Hit& hit, int pixel, const Values& behind, const Vec3<float>& ray, ByPose& sums) const {
    const Listed& listed = *hit.listed;
    if (listed.at.opacity[pixel] < options_.alpha_max) {
      const RhoSlope rho = (listed.at.on_plane >> pixel & 1) != 0
                               ? plane_slope(listed.axes, camera_, ray, listed.at, pixel, *listed.splat)
                               : screen_slope(listed.axes, camera_, listed.at, pixel, saved_.rho_per_pixel2);
      const Vec3<float> turn = cross(rho.at - load3<float>(pivot_.row(listed.body)), rho.slope);
      // More of the hit means less of what is behind it: d ln α = −dρ/2.
      const float dimmed = hit.alpha / (1 - hit.alpha);
      Values by_rho;
      for (size_t c = 0; c < by_rho.size(); ++c)
        by_rho[c] = -0.5F * (hit.weight * listed.values[c] - dimmed * behind[c]);
      for (size_t k = 0; k < 3; ++k) {
        const float by_turn = turn[static_cast<int>(k)], by_shift = rho.slope[static_cast<int>(k)];
        for (size_t c = 0; c < by_rho.size(); ++c) sums[k][c] += by_turn * by_rho[c];
        for (size_t c = 0; c < by_rho.size(); ++c) sums[3 + k][c] += by_shift * by_rho[c];
      }
    }
    const Vec3<float> normal = hit.weight * load3<float>(listed.splat->normal);
    for (size_t axis = 0; axis < 3; ++axis) {
      Vec3<float> about(0);
      about[static_cast<int>(axis)] = 1;
      add3(&sums[axis][1], cross(about, normal));
    }
  }

  const PosedSurfels& surfels_;
  const Tensor<int32_t>& body_;
  const Tensor<float>& pivot_;
  const Camera<float>& camera_;
  const Options& options_;
  const Saved& saved_;
  Tensor<float>& jacobian_;
  std::vector<Listed> listed_;
  std::vector<Hit> hits_;
  std::vector<ByPose> sums_;
};

// [begin, end): range of tiles.
void differentiate_tiles(const PosedSurfels& surfels, const Tensor<int32_t>& body, const Tensor<float>& pivot,
                         const Camera<float>& camera, const Options& options, const Saved& saved,
                         int64_t begin, int64_t end, Tensor<float>& jacobian) {
  BodyTile tile(surfels, body, pivot, camera, options, saved, jacobian);
  for (int64_t t = begin; t < end; ++t) tile.run(t);
}

}  // namespace traceflow::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace traceflow::raster {

HWY_EXPORT(differentiate_tiles);

void body_jacobian(const PosedSurfels& surfels, const Tensor<int32_t>& body, const Tensor<float>& pivot,
                   const Camera<float>& camera, const Options& options, const Saved& saved,
                   Tensor<float>& jacobian) {
  require(surfels.device() == Device::cpu, "bodies are drawn on the CPU", "");
  require(options.sort == SortOrder::centre, "surfels in the order of their centres", "");
  require(body.size() == surfels.count(), "each posed surfel has a body or none",
          std::to_string(body.size()));
  require(saved.count == surfels.count() && saved.width == camera.width && saved.height == camera.height,
          "derivatives follow forward of the same surfels and camera", std::to_string(surfels.count()));
  jacobian.reset({camera.height, camera.width, 6 * pivot.dim(0), 7});
  const auto differentiate = HWY_DYNAMIC_DISPATCH(differentiate_tiles);
  parallel_blocks("raster: body jacobian", saved.tiles(), 4, [&](int64_t begin, int64_t end) {
    differentiate(surfels, body, pivot, camera, options, saved, begin, end, jacobian);
  });
}

}  // namespace traceflow::raster
#endif
