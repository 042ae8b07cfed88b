#include <cstddef>

#include "ops/raster/cuda/stages.h"
#include "ops/raster/cuda/tile.h"

// Differentiates the blending of tiles, back to front: the transmittance in front of a hit is that behind it
// divided by 1 - α. A warp sums a splat over its pixels, and a tile sums it over its warps, both in a fixed
// order. No two tiles write to the same address.
namespace traceflow::raster::cuda_stage {
namespace {

constexpr int backward_batch = 32;
// The places of SplatGradient's fields among its numbers.
namespace sum_of {
enum Place : int {
  u_x = offsetof(SplatGradient, u_x) / sizeof(float),
  u_y = offsetof(SplatGradient, u_y) / sizeof(float),
  u_1 = offsetof(SplatGradient, u_1) / sizeof(float),
  v_x = offsetof(SplatGradient, v_x) / sizeof(float),
  v_y = offsetof(SplatGradient, v_y) / sizeof(float),
  v_1 = offsetof(SplatGradient, v_1) / sizeof(float),
  w_x = offsetof(SplatGradient, w_x) / sizeof(float),
  w_y = offsetof(SplatGradient, w_y) / sizeof(float),
  w_1 = offsetof(SplatGradient, w_1) / sizeof(float),
  z_plane = offsetof(SplatGradient, z_plane) / sizeof(float),
  centre_x = offsetof(SplatGradient, centre_x) / sizeof(float),
  centre_y = offsetof(SplatGradient, centre_y) / sizeof(float),
  z_centre = offsetof(SplatGradient, z_centre) / sizeof(float),
  log_opacity = offsetof(SplatGradient, log_opacity) / sizeof(float),
  colour = offsetof(SplatGradient, colour) / sizeof(float),
  tint = offsetof(SplatGradient, tint) / sizeof(float),
  normal = offsetof(SplatGradient, normal) / sizeof(float),
  roughness = offsetof(SplatGradient, roughness) / sizeof(float),
  count = roughness + 1
};
}  // namespace sum_of

constexpr int sums_stored = sizeof(SplatGradient) / sizeof(float);
static_assert(sums_stored <= cuda::warp_lanes && backward_batch == cuda::warp_lanes);

// Addresses; null for an output without gradient.
struct GradientView {
  const float *colour, *alpha, *tint, *silhouette, *roughness, *normal, *depth, *median_depth, *distortion;
};
struct KeptPixels {
  const float *transmittance, *alpha, *depth, *m, *m2, *inverse_z;
  const int32_t *last, *median;
};

// dL/doutput of a pixel and what forward saved for it.
template <Asked asked>
struct PixelGradient {
  Vec3<float> colour{0.0F}, normal{0.0F};
  float tint = 0, silhouette = 0, roughness = 0;
  float z = 0;         // dL/d(Σ w z)
  float constant = 0;  // the part of dL/dw that is the same for all hits
  float median = 0, distortion = 0;
  float alpha = 0, m = 0, m2 = 0, inverse_z = 0;
  int last = -1, median_place = -1;

  __device__ PixelGradient(const GradientView& g, const KeptPixels& left, const Vec3<float>& background,
                           int64_t i) {
    const auto value = [i](const float* from) { return from != nullptr ? from[i] : 0.0F; };
    if (g.colour != nullptr) colour = load3<float>(g.colour + 3 * i);
    tint = value(g.tint);
    silhouette = value(g.silhouette);
    roughness = value(g.roughness);
    alpha = left.alpha[i];
    last = left.last[i];
    constant = value(g.alpha) - dot(colour, background);
    if constexpr (asked != Asked::colour) {
      if (g.normal != nullptr) normal = load3<float>(g.normal + 3 * i);
      // Expected depth is Σ w z / Σ w.
      z = alpha > 0 ? value(g.depth) / alpha : 0.0F;
      constant -= z * left.depth[i];
    }
    if constexpr (asked == Asked::all) {
      median = value(g.median_depth);
      distortion = value(g.distortion);
      m = left.m[i];
      m2 = left.m2[i];
      inverse_z = left.inverse_z[i];
      median_place = left.median[i];
    }
  }
  __device__ PixelGradient() {}

  // dL/dw of a hit.
  __device__ float by_weight(const KernelOptions& o, const Splat& s, const PixelFootprint& f) const {
    float own = constant + dot(load3<float>(s.colour), colour) + s.tint * tint + s.carried() * silhouette +
                s.roughness() * roughness;
    if constexpr (asked != Asked::colour) own += f.z(s) * z + dot(load3<float>(s.normal), normal);
    if constexpr (asked == Asked::all) {
      // dL/dw_i = g (m² A + M2 - 2 m M1)
      const float m_hit = o.m_scale * (inverse_z - f.inverse_z(s));
      own += distortion * (m2 - m_hit * ((m - m_hit * alpha) + m));
    }
    return own;
  }

  // Adds a hit to the sums of a splat, in the order of SplatGradient.
  __device__ void add(const KernelOptions& o, const Splat& s, const PixelFootprint& f, float weight,
                      float grad_alpha, bool is_median, float* sums) const {
    const float z_hit = f.z(s);
    float grad_z = 0;
    if constexpr (asked != Asked::colour) grad_z = weight * z;
    if constexpr (asked == Asked::all) {
      // dL/dm_i = 2 g w (m A - M1)
      const float inverse = f.inverse_z(s);
      const float m_hit = o.m_scale * (inverse_z - inverse);
      grad_z -= 2.0F * distortion * weight * (m - m_hit * alpha) * (o.m_scale * inverse * inverse);
      if (is_median) grad_z += median;
    }
    // G = exp(-ρ/2): dL/dρ = -g/2 with g = o·G · dL/d(o·G), zero if α is clamped.
    const float g = f.opacity < o.alpha_max ? f.opacity * grad_alpha : 0.0F;
    if (f.on_plane) {
      // u = nu/w, v = nv/w, z = z_plane/w, ρ = u² + v².
      const float u = f.nu * f.inverse_w;
      const float v = f.nv * f.inverse_w;
      const float gw = g * f.inverse_w;
      const float zw = grad_z * f.inverse_w;
      const float grad_nu = -gw * u;
      const float grad_nv = -gw * v;
      const float grad_w = gw * (u * u + v * v) - zw * z_hit;
      sums[sum_of::u_x] += grad_nu * f.x;
      sums[sum_of::u_y] += grad_nu * f.y;
      sums[sum_of::u_1] += grad_nu;
      sums[sum_of::v_x] += grad_nv * f.x;
      sums[sum_of::v_y] += grad_nv * f.y;
      sums[sum_of::v_1] += grad_nv;
      sums[sum_of::w_x] += grad_w * f.x;
      sums[sum_of::w_y] += grad_w * f.y;
      sums[sum_of::w_1] += grad_w;
      sums[sum_of::z_plane] += zw;
    } else {
      // The low-pass: ρ = rho_per_pixel2 (dx² + dy²).
      sums[sum_of::centre_x] += g * f.dx;
      sums[sum_of::centre_y] += g * f.dy;
      sums[sum_of::z_centre] += grad_z;
    }
    sums[sum_of::log_opacity] += g;
    for (int c = 0; c < 3; ++c) sums[sum_of::colour + c] += weight * colour[c];
    sums[sum_of::tint] += weight * tint;
    for (int c = 0; c < 3; ++c) sums[sum_of::normal + c] += weight * normal[c];
    sums[sum_of::roughness] += weight * roughness;
  }
};

// Returns to lane i the sum of value[i] over the lanes; overwrites value. Needs 31 exchanges instead of five
// per value. A recursion, so that the compiler knows every index and keeps value in registers.
template <int half = cuda::warp_lanes / 2>
__device__ float transposed_sum(float (&value)[cuda::warp_lanes], int lane) {
  const bool upper = (lane & half) != 0;
#pragma unroll
  for (int i = 0; i < half; ++i) {
    const float keep = upper ? value[i + half] : value[i];
    const float send = upper ? value[i] : value[i + half];
    value[i] = keep + __shfl_xor_sync(cuda::full_warp, send, half);
  }
  if constexpr (half > 1) {
    return transposed_sum<half / 2>(value, lane);
  } else {
    return value[0];
  }
}

template <Asked asked>
__global__ void __launch_bounds__(pixels_per_tile)
    blend_backward_by_centre(SavedView saved, KernelOptions o, GradientView grad, KeptPixels left,
                             SplatGradient* gradients) {
  __shared__ BatchSplat batch[backward_batch];
  __shared__ float partial[warps_per_tile][backward_batch][sums_stored];
  __shared__ unsigned written[warps_per_tile];
  __shared__ int last_place;
  const int tile = static_cast<int>(blockIdx.x);
  const TilePixel pixel(saved, tile);
  const uint32_t begin = saved.tile_begin[tile];

  PixelGradient<asked> g;
  float transmittance = 1, behind = 0;
  if (pixel.in_image) {
    g = PixelGradient<asked>(grad, left, o.background, pixel.index);
    transmittance = left.transmittance[pixel.index];
  }
  if (threadIdx.x == 0) last_place = -1;
  __syncthreads();
  if (g.last >= 0) atomicMax(&last_place, g.last);
  __syncthreads();

  for (int base = last_place / backward_batch * backward_batch; base >= 0 && last_place >= 0;
       base -= backward_batch) {
    const int here = last_place + 1 - base < backward_batch ? last_place + 1 - base : backward_batch;
    load_batch(saved, begin + static_cast<uint32_t>(base), here, batch);
    __syncthreads();
    unsigned mine = 0;
    for (unsigned left_over = reached_splats(pixel, batch, 0, here); left_over != 0;) {
      const int k = cuda::warp_lanes - 1 - __clz(static_cast<int>(left_over));
      left_over &= ~(1U << k);
      const Splat& s = batch[k];
      const PixelFootprint f = pixel.footprint_of(s);
      const bool hit = f.inside && base + k <= g.last;
      if (__ballot_sync(cuda::full_warp, hit) == 0) continue;
      float sums[cuda::warp_lanes] = {};
      if (hit) {
        const float alpha = lower(f.opacity, o.alpha_max);
        const float past = 1.0F / (1.0F - alpha);
        transmittance *= past;
        const float weight = alpha * transmittance;
        const float own = g.by_weight(o, s, f);
        g.add(o, s, f, weight, transmittance * own - behind * past, g.median_place == base + k, sums);
        behind += weight * own;
      }
      const float sum = transposed_sum(sums, pixel.lane);
      if (pixel.lane < sums_stored) partial[pixel.warp][k][pixel.lane] = sum;
      mine |= 1U << k;
    }
    if (pixel.lane == 0) written[pixel.warp] = mine;
    __syncthreads();
    for (int i = static_cast<int>(threadIdx.x); i < here * sums_stored; i += pixels_per_tile) {
      const int k = i / sums_stored, j = i % sums_stored;
      float sum = 0;
      bool any = false;
      for (int warp = 0; warp < warps_per_tile; ++warp) {
        if ((written[warp] >> k & 1U) == 0) continue;
        sum += partial[warp][k][j];
        any = true;
      }
      if (any) (&gradients[saved.entries[begin + base + k].entry].u_x)[j] = sum;
    }
    __syncthreads();
  }
}

// sort = hit: every pixel has its own order, so each processes its hits alone, twice: once for the sum over
// all hits and once for the sums behind each. in_turn: the threads of a tile run one after another, so that
// sums have a fixed order.
template <Asked asked>
__global__ void blend_backward_by_hit(SavedView saved, KernelOptions o, GradientView grad, KeptPixels left,
                                      SplatGradient* gradients, bool in_turn) {
  const int tile = static_cast<int>(blockIdx.x);
  const TilePixel pixel(saved, tile);
  const uint32_t begin = saved.tile_begin[tile];
  const uint32_t end = saved.tile_begin[tile + 1];
  const auto run = [&] {
    const PixelGradient<asked> g(grad, left, o.background, pixel.index);
    float all = 0;
    float transmittance = 1;
    int taken = 0;
    const auto for_each_taken = [&](auto&& f) {
      transmittance = 1;
      taken = 0;
      for_each_hit(saved, pixel, begin, end, [&](uint32_t place, const Splat& s, const PixelFootprint& at) {
        if (taken > g.last) return false;
        const float alpha = lower(at.opacity, o.alpha_max);
        const float weight = alpha * transmittance;
        f(place, s, at, alpha, weight, weight * g.by_weight(o, s, at));
        transmittance -= weight;
        ++taken;
        return true;
      });
    };
    for_each_taken(
        [&](uint32_t, const Splat&, const PixelFootprint&, float, float, float share) { all += share; });
    float done = 0;
    for_each_taken([&](uint32_t place, const Splat& s, const PixelFootprint& at, float alpha, float weight,
                       float share) {
      done += share;
      const float own = g.by_weight(o, s, at);
      const float grad_alpha = transmittance * own - (all - done) / (1.0F - alpha);
      float sums[sum_of::count] = {};
      g.add(o, s, at, weight, grad_alpha, g.median_place == taken, sums);
      float* const to = &gradients[saved.entries[begin + place].entry].u_x;
      for (int j = 0; j < sum_of::count; ++j) {
        if (sums[j] != 0) atomicAdd(to + j, sums[j]);
      }
    });
  };
  if (!in_turn) {
    if (pixel.in_image) run();
    return;
  }
  for (int turn = 0; turn < pixels_per_tile; ++turn) {
    if (turn == static_cast<int>(threadIdx.x) && pixel.in_image) run();
    __syncthreads();
  }
}

template <Asked asked>
void blend_backward(const Options& options, const Saved& saved, const GradientView& grad) {
  const Saved::Pixels& p = saved.pixels;
  const KeptPixels left{p.transmittance.data(), p.alpha.data(), p.depth.data(), p.m.data(), p.m2.data(),
                        p.inverse_z.data(),     p.last.data(),  p.median.data()};
  Tensor<SplatGradient>& gradients = saved.scratch.gradients;
  gradients.place(Device::cuda).resize({saved.entries.size()});
  const SavedView view = view_of(saved, nullptr);
  const KernelOptions kernel_options(options);
  const cuda::Grid grid{saved.tiles(), pixels_per_tile};
  if (options.sort == SortOrder::centre) {
    cuda::launch("raster: blend backward", grid, blend_backward_by_centre<asked>, view, kernel_options, grad,
                 left, gradients.data());
  } else {
    gradients.zero();
    cuda::launch("raster: blend backward by hit", grid, blend_backward_by_hit<asked>, view, kernel_options,
                 grad, left, gradients.data(), cuda::deterministic());
  }
}

}  // namespace

void blend_backward(const Options& options, const Saved& saved, const OutputGradient& g) {
  const auto asked = [](const Tensor<float>& tensor) { return tensor.empty() ? nullptr : tensor.data(); };
  const GradientView grad{asked(g.colour),     asked(g.alpha),        asked(g.tint),
                          asked(g.silhouette), asked(g.roughness),    asked(g.normal),
                          asked(g.depth),      asked(g.median_depth), asked(g.distortion)};
  const Asked asked_outputs = asked_by(g);
  if (asked_outputs == Asked::all) {
    blend_backward<Asked::all>(options, saved, grad);
  } else if (asked_outputs == Asked::geometry) {
    blend_backward<Asked::geometry>(options, saved, grad);
  } else {
    blend_backward<Asked::colour>(options, saved, grad);
  }
}

}  // namespace traceflow::raster::cuda_stage
