#include "ops/raster/cuda/stages.h"

#include "ops/raster/cuda/tile.h"

// Blends the tiles, front to back (method §3.3, §3.5).
namespace traceflow::raster::cuda_stage {
namespace {

constexpr int forward_batch = 128;
static_assert(forward_batch <= pixels_per_tile);

struct OutputView {
  float *colour, *alpha, *tint, *normal, *depth, *median_depth, *distortion;
  float *silhouette, *roughness;  // null if not wanted
};
struct LeftPixels {
  float *transmittance, *alpha, *depth, *m, *m2, *inverse_z;
  int32_t *last, *median;
};

// The state of one pixel.
class Blend {
 public:
  // Blends a hit. place: its index in the blending order. Returns whether the pixel blended it. Ends the
  // pixel if the hit would leave too little transmittance.
  __device__ bool add(const KernelOptions& o, const Splat& s, const PixelFootprint& f, int place) {
    if (!f.inside) return false;
    const float weight = transmittance_ * lower(f.opacity, o.alpha_max);
    if (transmittance_ - weight < o.transmittance_min) {
      ended_ = true;
      return false;
    }
    const float z = f.z(s);
    const float inverse_z = f.inverse_z(s);
    if (transmittance_ == 1.0F) first_inverse_z_ = inverse_z;
    const float m = first_inverse_z_ - inverse_z;
    m_ += weight * m;
    m2_ += weight * m * m;
    // The median hit is the last one that starts with a transmittance above one half. There is none if the
    // transmittance never falls to one half.
    if (transmittance_ > 0.5F) {
      median_depth_ = z;
      median_ = place;
    }
    last_ = place;
    alpha_ += weight;
    colour_ += weight * load3<float>(s.colour);
    tint_ += weight * s.tint;
    silhouette_ += weight * s.in_body();
    roughness_ += weight * s.roughness();
    normal_ += weight * load3<float>(s.normal);
    depth_ += weight * z;
    transmittance_ -= weight;
    return true;
  }
  __device__ bool ended() const { return ended_; }

  __device__ void store(const KernelOptions& o, int64_t i, const OutputView& out,
                        const LeftPixels& left) const {
    store3(out.colour + 3 * i, colour_ + transmittance_ * o.background);
    store3(out.normal + 3 * i, normal_);
    const bool has_median = transmittance_ <= 0.5F;
    const float depth = alpha_ > 0.0F ? depth_ / alpha_ : 0.0F;
    // Σ over pairs of w_i w_j (m_i - m_j)² = A M2 - M1²
    const float m = o.m_scale * m_;
    const float m2 = o.m_scale * o.m_scale * m2_;
    out.alpha[i] = alpha_;
    out.tint[i] = tint_;
    if (out.silhouette != nullptr) out.silhouette[i] = silhouette_;
    if (out.roughness != nullptr) out.roughness[i] = roughness_;
    out.depth[i] = depth;
    out.median_depth[i] = has_median ? median_depth_ : 0.0F;
    out.distortion[i] = higher(alpha_ * m2 - m * m, 0.0F);
    left.transmittance[i] = transmittance_;
    left.alpha[i] = alpha_;
    left.depth[i] = depth;
    left.m[i] = m;
    left.m2[i] = m2;
    left.inverse_z[i] = first_inverse_z_;
    left.last[i] = last_;
    left.median[i] = has_median ? median_ : -1;
  }

 private:
  float transmittance_ = 1, alpha_ = 0, tint_ = 0, silhouette_ = 0, roughness_ = 0, depth_ = 0, m_ = 0,
        m2_ = 0;
  float first_inverse_z_ = 0, median_depth_ = 0;
  Vec3<float> colour_{0.0F}, normal_{0.0F};
  int last_ = -1, median_ = -1;
  bool ended_ = false;
};

__global__ void blend_by_centre(SavedView saved, KernelOptions o, OutputView out, LeftPixels left) {
  __shared__ BatchSplat batch[forward_batch];
  __shared__ unsigned touched[forward_batch];
  const int tile = static_cast<int>(blockIdx.x);
  const TilePixel pixel(saved, tile);
  const uint32_t begin = saved.tile_begin[tile];
  const uint32_t count = saved.tile_begin[tile + 1] - begin;

  Blend blend;
  bool live = pixel.in_image;
  for (uint32_t base = 0; base < count; base += forward_batch) {
    const int here = static_cast<int>(count - base < forward_batch ? count - base : forward_batch);
    if (__syncthreads_or(live) == 0) {
      // No pixel needs the rest of the list.
      for (uint32_t k = base + threadIdx.x; k < count; k += blockDim.x) {
        saved.touched[saved.entries[begin + k].entry] = 0;
      }
      break;
    }
    load_batch(saved, begin + base, here, batch);
    if (static_cast<int>(threadIdx.x) < here) touched[threadIdx.x] = 0;
    __syncthreads();
    if (__any_sync(cuda::full_warp, live)) {
      for (int first = 0; first < here; first += cuda::warp_lanes) {
        for (unsigned left_over = reached_splats(pixel, batch, first, here); left_over != 0;
             left_over &= left_over - 1) {
          const int k = first + __ffs(static_cast<int>(left_over)) - 1;
          bool took = false;
          if (live) {
            const Splat& s = batch[k];
            took = blend.add(o, s, pixel.footprint_of(s), static_cast<int>(base) + k);
            live = !blend.ended();
          }
          const unsigned lanes = __ballot_sync(cuda::full_warp, took);
          if (pixel.lane == 0 && lanes != 0) atomicOr(&touched[k], touched_bits(pixel.warp, lanes));
        }
      }
    }
    __syncthreads();
    if (static_cast<int>(threadIdx.x) < here) {
      saved.touched[saved.entries[begin + base + threadIdx.x].entry] =
          static_cast<uint16_t>(touched[threadIdx.x]);
    }
  }
  if (pixel.in_image) blend.store(o, pixel.index, out, left);
}

// sort = hit: each pixel blends its hits by their own depth, a few at a time.
__global__ void blend_by_hit(SavedView saved, KernelOptions o, OutputView out, LeftPixels left) {
  const int tile = static_cast<int>(blockIdx.x);
  const TilePixel pixel(saved, tile);
  const uint32_t begin = saved.tile_begin[tile];
  const uint32_t end = saved.tile_begin[tile + 1];
  if (!pixel.in_image) return;
  Blend blend;
  int taken = 0;
  for_each_hit(saved, pixel, begin, end, [&](uint32_t place, const Splat& s, const PixelFootprint& f) {
    if (!blend.add(o, s, f, taken)) return false;
    ++taken;
    add_touched(saved.touched, saved.entries[begin + place].entry,
                touched_bits(pixel.warp, 1U << pixel.lane));
    return true;
  });
  blend.store(o, pixel.index, out, left);
}

}  // namespace

void blend(const Options& options, Output& output, Saved& saved) {
  const Shape plane{saved.height, saved.width};
  const Shape vectors{saved.height, saved.width, 3};
  const auto resized = [](auto& tensor, const Shape& shape) {
    tensor.place(Device::cuda).resize(shape);
    return tensor.data();
  };
  const OutputView out{resized(output.colour, vectors),
                       resized(output.alpha, plane),
                       resized(output.tint, plane),
                       resized(output.normal, vectors),
                       resized(output.depth, plane),
                       resized(output.median_depth, plane),
                       resized(output.distortion, plane),
                       saved.has_silhouette ? resized(output.silhouette, plane) : nullptr,
                       saved.has_roughness ? resized(output.roughness, plane) : nullptr};
  if (!saved.has_silhouette) resized(output.silhouette, Shape{0});
  if (!saved.has_roughness) resized(output.roughness, Shape{0});
  Saved::Pixels& p = saved.pixels;
  const LeftPixels left{resized(p.transmittance, plane),
                        resized(p.alpha, plane),
                        resized(p.depth, plane),
                        resized(p.m, plane),
                        resized(p.m2, plane),
                        resized(p.inverse_z, plane),
                        resized(p.last, plane),
                        resized(p.median, plane)};
  // Padded by one, so that pairs of flags can be updated as words.
  uint16_t* const touched = resized(saved.touched, Shape{saved.entries.size() + 1});
  const SavedView view = view_of(saved, touched);
  const KernelOptions kernel_options(options);
  const cuda::Grid grid{saved.tiles(), pixels_per_tile};
  if (options.sort == SortOrder::centre) {
    cuda::launch("raster: blend", grid, blend_by_centre, view, kernel_options, out, left);
  } else {
    saved.touched.zero();
    cuda::launch("raster: blend by hit", grid, blend_by_hit, view, kernel_options, out, left);
  }
}

}  // namespace traceflow::raster::cuda_stage
