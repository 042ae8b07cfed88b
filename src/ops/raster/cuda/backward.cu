#include "ops/raster/cuda/stages.h"
#include "ops/raster/cuda/tile.h"
#include "ops/raster/hit_gradient-inl.h"

// Differentiates the blending of tiles, back to front: the transmittance in front of a hit is that behind it
// divided by 1 - α. A warp sums a splat over its pixels, and a tile sums it over its warps, both in a fixed
// order. No two tiles write to the same address.
namespace traceflow::raster::cuda_stage {
namespace {

constexpr int backward_batch = 32;
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

// The arithmetic of hit_gradient-inl.h on one pixel.
struct OneLane {
  __device__ float at(float x) const { return x; }
  __device__ float set(float x) const { return x; }
  __device__ float add(float a, float b) const { return a + b; }
  __device__ float sub(float a, float b) const { return a - b; }
  __device__ float mul(float a, float b) const { return a * b; }
  __device__ float neg(float a) const { return -a; }
  __device__ float mul_add(float a, float b, float c) const { return std::fma(a, b, c); }
  __device__ float neg_mul_add(float a, float b, float c) const { return std::fma(-a, b, c); }
  __device__ bool less(float a, float b) const { return a < b; }
  __device__ bool both(bool a, bool b) const { return a && b; }
  __device__ float zero_unless(bool mask, float a) const { return mask ? a : 0.0F; }
  __device__ float zero_if(bool mask, float a) const { return mask ? 0.0F : a; }
  __device__ bool may_hold(bool mask) const { return mask; }
  __device__ bool may_fail(bool mask) const { return !mask; }
  __device__ float z(const PixelFootprint& f, const Splat& s) const { return f.z(s); }
  __device__ float inverse_z(const PixelFootprint& f, const Splat& s) const { return f.inverse_z(s); }
};

// What forward saved for a pixel.
struct KeptPixel {
  float alpha = 0, m = 0, m2 = 0, inverse_z = 0;
  int last = -1, median = -1;

  __device__ KeptPixel() {}
  __device__ KeptPixel(const KeptPixels& kept, int64_t i)
      : alpha(kept.alpha[i]),
        m(kept.m[i]),
        m2(kept.m2[i]),
        inverse_z(kept.inverse_z[i]),
        last(kept.last[i]),
        median(kept.median[i]) {}
};

// dL/doutput of a pixel.
template <Asked asked>
struct PixelGradient {
  Vec3<float> colour{0.0F}, normal{0.0F};
  float tint = 0, silhouette = 0, roughness = 0;
  float z = 0;         // dL/d(Σ w z)
  float constant = 0;  // the part of dL/dw that is the same for all hits
  float median = 0, distortion = 0;

  __device__ PixelGradient() {}
  __device__ PixelGradient(const GradientView& g, const KeptPixels& kept, const Vec3<float>& background,
                           int64_t i) {
    const auto value = [i](const float* from) { return from != nullptr ? from[i] : 0.0F; };
    if (g.colour != nullptr) colour = load3<float>(g.colour + 3 * i);
    tint = value(g.tint);
    silhouette = value(g.silhouette);
    roughness = value(g.roughness);
    constant = value(g.alpha) - dot(colour, background);
    if constexpr (asked != Asked::colour) {
      if (g.normal != nullptr) normal = load3<float>(g.normal + 3 * i);
      // Expected depth is Σ w z / Σ w.
      z = kept.alpha[i] > 0 ? value(g.depth) / kept.alpha[i] : 0.0F;
      constant -= z * kept.depth[i];
    }
    if constexpr (asked == Asked::all) {
      median = value(g.median_depth);
      distortion = value(g.distortion);
    }
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
    blend_backward_by_centre(SavedView saved, KernelOptions o, GradientView grad, KeptPixels kept,
                             SplatGradient* gradients) {
  __shared__ BatchSplat batch[backward_batch];
  __shared__ float partial[warps_per_tile][backward_batch][sums_stored];
  __shared__ unsigned written[warps_per_tile];
  __shared__ int last_place;
  const int tile = static_cast<int>(blockIdx.x);
  const TilePixel pixel(saved, tile);
  const uint32_t begin = saved.tile_begin[tile];

  PixelGradient<asked> g;
  KeptPixel own;
  float transmittance = 1, behind = 0;
  if (pixel.in_image) {
    g = PixelGradient<asked>(grad, kept, o.background, pixel.index);
    own = KeptPixel(kept, pixel.index);
    transmittance = kept.transmittance[pixel.index];
  }
  if (threadIdx.x == 0) last_place = -1;
  __syncthreads();
  if (own.last >= 0) atomicMax(&last_place, own.last);
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
      const bool hit = f.inside && base + k <= own.last;
      if (__ballot_sync(cuda::full_warp, hit) == 0) continue;
      SplatGradient sums{};
      if (hit) {
        const float alpha = lower(f.opacity, o.alpha_max);
        const float past = 1.0F / (1.0F - alpha);
        transmittance *= past;
        const float weight = alpha * transmittance;
        const float by_weight = scalar::grad_weight<asked>(OneLane{}, o, s, f, g, own);
        scalar::add_hit<asked>(OneLane{}, o, s, f, g, own, weight, transmittance * by_weight - behind * past,
                               hit, own.median == base + k, sums);
        behind += weight * by_weight;
      }
      float values[cuda::warp_lanes] = {};
#pragma unroll
      for (int j = 0; j < sums_stored; ++j) values[j] = (&sums.u_x)[j];
      const float sum = transposed_sum(values, pixel.lane);
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
__global__ void blend_backward_by_hit(SavedView saved, KernelOptions o, GradientView grad, KeptPixels kept,
                                      SplatGradient* gradients, bool in_turn) {
  const int tile = static_cast<int>(blockIdx.x);
  const TilePixel pixel(saved, tile);
  const uint32_t begin = saved.tile_begin[tile];
  const uint32_t end = saved.tile_begin[tile + 1];
  const auto run = [&] {
    const PixelGradient<asked> g(grad, kept, o.background, pixel.index);
    const KeptPixel own(kept, pixel.index);
    float all = 0;
    float transmittance = 1;
    int taken = 0;
    const auto for_each_taken = [&](auto&& f) {
      transmittance = 1;
      taken = 0;
      for_each_hit(saved, pixel, begin, end, [&](uint32_t place, const Splat& s, const PixelFootprint& at) {
        if (taken > own.last) return false;
        const float alpha = lower(at.opacity, o.alpha_max);
        const float weight = alpha * transmittance;
        f(place, s, at, alpha, weight, weight * scalar::grad_weight<asked>(OneLane{}, o, s, at, g, own));
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
      const float by_weight = scalar::grad_weight<asked>(OneLane{}, o, s, at, g, own);
      const float grad_alpha = transmittance * by_weight - (all - done) / (1.0F - alpha);
      SplatGradient sums{};
      scalar::add_hit<asked>(OneLane{}, o, s, at, g, own, weight, grad_alpha, true, own.median == taken,
                             sums);
      float* const to = &gradients[saved.entries[begin + place].entry].u_x;
      const float* const from = &sums.u_x;
#pragma unroll
      for (int j = 0; j < sums_stored; ++j) {
        if (from[j] != 0) atomicAdd(to + j, from[j]);
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
  const KeptPixels kept{p.transmittance.data(), p.alpha.data(), p.depth.data(), p.m.data(), p.m2.data(),
                        p.inverse_z.data(),     p.last.data(),  p.median.data()};
  Tensor<SplatGradient>& gradients = saved.scratch.gradients;
  gradients.place(Device::cuda).resize({saved.entries.size()});
  const SavedView view = view_of(saved, nullptr);
  const KernelOptions kernel_options(options);
  const cuda::Grid grid{saved.tiles(), pixels_per_tile};
  if (options.sort == SortOrder::centre) {
    cuda::launch("raster: blend backward", grid, blend_backward_by_centre<asked>, view, kernel_options, grad,
                 kept, gradients.data());
  } else {
    gradients.zero();
    cuda::launch("raster: blend backward by hit", grid, blend_backward_by_hit<asked>, view, kernel_options,
                 grad, kept, gradients.data(), cuda::deterministic());
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
