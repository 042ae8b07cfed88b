#include <cstring>

#include "base/parallel.h"
#include "ops/raster/raster_kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "ops/raster/cpu/backward.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "ops/raster/cpu/simd-inl.h"

// Differentiates the blending of tiles, back to front: the transmittance in front of a hit is that behind it
// divided by 1 - α. The sums of a surfel over the blocks of a tile stay in registers. They are reduced once
// to the tile's SplatGradient of the surfel.
HWY_BEFORE_NAMESPACE();
namespace traceflow::raster::HWY_NAMESPACE {

// dL/doutput of a block, and the state of its pixels at the current hit.
struct BlockState {
  alignas(64) float colour[3][pixels_per_block];
  alignas(64) float normal[3][pixels_per_block];
  alignas(64) float tint[pixels_per_block];
  alignas(64) float silhouette[pixels_per_block];
  alignas(64) float roughness[pixels_per_block];
  alignas(64) float z[pixels_per_block];         // dL/d(Σ w z)
  alignas(64) float constant[pixels_per_block];  // the part of dL/dw that is the same for all hits
  alignas(64) float median[pixels_per_block];
  alignas(64) float distortion[pixels_per_block];
  alignas(64) float transmittance[pixels_per_block];  // behind the current hit
  alignas(64) float behind[pixels_per_block];         // Σ w dL/dw over the hits behind
};

struct TileState {
  BlockState blocks[blocks_per_tile];
};

HWY_INLINE void load_pixel(const OutputGradient& g, const Vec3<float>& background, int64_t pixel, int i,
                           const SavedBlock& saved, BlockState& state) {
  const auto value = [&](const Tensor<float>& tensor, int64_t at) {
    return tensor.empty() ? 0.0F : tensor[at];
  };
  for (int c = 0; c < 3; ++c) {
    state.colour[c][i] = value(g.colour, 3 * pixel + c);
    state.normal[c][i] = value(g.normal, 3 * pixel + c);
  }
  state.tint[i] = value(g.tint, pixel);
  state.silhouette[i] = value(g.silhouette, pixel);
  state.roughness[i] = value(g.roughness, pixel);
  state.median[i] = value(g.median_depth, pixel);
  state.distortion[i] = value(g.distortion, pixel);
  // Expected depth is Σ w z / Σ w. The background has the weight 1 - Σ w.
  const float z = saved.alpha[i] > 0 ? value(g.depth, pixel) / saved.alpha[i] : 0.0F;
  state.z[i] = z;
  state.constant[i] = value(g.alpha, pixel) - z * saved.depth[i] -
                      (state.colour[0][i] * background.x + state.colour[1][i] * background.y +
                       state.colour[2][i] * background.z);
  state.transmittance[i] = saved.transmittance[i];
}

HWY_INLINE void load_block(const OutputGradient& g, const Vec3<float>& background, int block_x, int block_y,
                           int width, int height, const SavedBlock& saved, BlockState& state) {
  std::memset(&state, 0, sizeof(state));
  const int rows = std::min(block_edge, height - block_y);
  const int columns = std::min(block_edge, width - block_x);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const int64_t pixel = int64_t{block_y + row} * width + block_x + column;
      load_pixel(g, background, pixel, row * block_edge + column, saved, state);
    }
  }
}

// The sums of a surfel over pixels, one per lane, in the order of SplatGradient.
template <class D>
struct Sums {
  static constexpr int used = 22;
  static constexpr int padded = 24;
  V<D> u_x, u_y, u_1, v_x, v_y, v_1, w_x, w_y, w_1, z_plane, centre_x, centre_y, z_centre, log_opacity;
  V<D> red, green, blue, tint, normal_x, normal_y, normal_z, roughness;

  HWY_INLINE explicit Sums(D d) {
    u_x = u_y = u_1 = v_x = v_y = v_1 = w_x = w_y = w_1 = z_plane = centre_x = centre_y = z_centre =
        log_opacity = red = green = blue = tint = normal_x = normal_y = normal_z = roughness = hn::Zero(d);
  }

  // Adds one hit per lane and moves the state in front of it.
  template <Asked asked>
  HWY_INLINE void add(D d, const KernelOptions& o, const Splat& s, const Footprint<D>& f, uint32_t place,
                      const SavedBlock& saved, size_t lane, BlockState& state) {
    const Int<D> di;
    const auto set = [d](float x) HWY_ATTR { return hn::Set(d, x); };
    const auto load = [d, lane](const float* p) HWY_ATTR { return hn::LoadU(d, p + lane); };
    const auto here = hn::Set(di, static_cast<int32_t>(place));
    const auto is_blended = hn::Not(hn::Lt(hn::LoadU(di, saved.last + lane), here));
    const auto hit = hn::And(f.inside, hn::RebindMask(d, is_blended));
    const auto on_plane = hn::And(hit, f.on_plane);

    const auto alpha_max = set(o.alpha_max);
    const auto alpha = hn::IfThenElseZero(hit, hn::Min(f.opacity, alpha_max));
    const auto past = reciprocal(d, hn::Sub(set(1.0F), alpha));
    const auto transmittance_behind = load(state.transmittance);
    const auto transmittance = hn::IfThenElse(hit, hn::Mul(transmittance_behind, past), transmittance_behind);
    const auto weight = hn::Mul(alpha, transmittance);
    const auto z = f.z(d, s);

    auto own = load(state.constant);
    auto grad_z = hn::Zero(d);
    if constexpr (asked != Asked::colour) {
      own = hn::MulAdd(z, load(state.z), own);
      grad_z = hn::Mul(weight, load(state.z));
    }
    own = hn::MulAdd(set(s.colour[0]), load(state.colour[0]), own);
    own = hn::MulAdd(set(s.colour[1]), load(state.colour[1]), own);
    own = hn::MulAdd(set(s.colour[2]), load(state.colour[2]), own);
    own = hn::MulAdd(set(s.tint), load(state.tint), own);
    own = hn::MulAdd(set(s.carried()), load(state.silhouette), own);
    own = hn::MulAdd(set(s.roughness()), load(state.roughness), own);
    if constexpr (asked != Asked::colour) {
      own = hn::MulAdd(set(s.normal[0]), load(state.normal[0]), own);
      own = hn::MulAdd(set(s.normal[1]), load(state.normal[1]), own);
      own = hn::MulAdd(set(s.normal[2]), load(state.normal[2]), own);
      normal_x = hn::MulAdd(weight, load(state.normal[0]), normal_x);
      normal_y = hn::MulAdd(weight, load(state.normal[1]), normal_y);
      normal_z = hn::MulAdd(weight, load(state.normal[2]), normal_z);
    }
    if constexpr (asked == Asked::all) {
      // dL/dw_i = g (m² A + M2 - 2 m M1), dL/dm_i = 2 g w (m A - M1)
      const auto inverse_z = f.inverse_z(d, s);
      const auto scale = set(o.m_scale);
      const auto m = hn::Mul(scale, hn::Sub(load(saved.inverse_z), inverse_z));
      const auto g = load(state.distortion);
      const auto ma = hn::NegMulAdd(m, load(saved.alpha), load(saved.m));  // M1 - m A
      const auto by_weight = hn::NegMulAdd(m, hn::Add(ma, load(saved.m)), load(saved.m2));
      own = hn::MulAdd(g, by_weight, own);
      const auto slope = hn::Mul(scale, hn::Mul(inverse_z, inverse_z));
      grad_z = hn::NegMulAdd(hn::Mul(hn::Mul(set(2.0F), g), hn::Mul(weight, ma)), slope, grad_z);
      const auto is_median = hn::RebindMask(d, hn::Eq(hn::LoadU(di, saved.median + lane), here));
      grad_z = hn::Add(grad_z, hn::IfThenElseZero(hn::And(hit, is_median), load(state.median)));
    }

    const auto behind = load(state.behind);
    const auto grad_alpha = hn::NegMulAdd(behind, past, hn::Mul(transmittance, own));
    hn::StoreU(hn::MulAdd(weight, own, behind), d, state.behind + lane);
    hn::StoreU(transmittance, d, state.transmittance + lane);

    red = hn::MulAdd(weight, load(state.colour[0]), red);
    green = hn::MulAdd(weight, load(state.colour[1]), green);
    blue = hn::MulAdd(weight, load(state.colour[2]), blue);
    tint = hn::MulAdd(weight, load(state.tint), tint);
    roughness = hn::MulAdd(weight, load(state.roughness), roughness);

    // G = exp(-ρ/2): dL/dρ = -g/2 with g = o·G · dL/d(o·G), zero if α is clamped.
    const auto is_free = hn::And(hit, hn::Lt(f.opacity, alpha_max));
    const auto g = hn::IfThenElseZero(is_free, hn::Mul(alpha, grad_alpha));
    log_opacity = hn::Add(log_opacity, g);
    add_plane<asked>(f, hn::IfThenElseZero(on_plane, g), hn::IfThenElseZero(on_plane, grad_z), z, on_plane);
    // The low-pass: ρ = rho_per_pixel2 (dx² + dy²).
    const auto by_centre = hn::IfThenZeroElse(on_plane, g);
    centre_x = hn::MulAdd(by_centre, f.dx, centre_x);
    centre_y = hn::MulAdd(by_centre, f.dy, centre_y);
    if constexpr (asked != Asked::colour) {
      z_centre = hn::Add(z_centre, hn::IfThenZeroElse(on_plane, grad_z));
    }
  }

  // The hit in the plane: u = nu/w, v = nv/w, z = z_plane/w, ρ = u² + v².
  template <Asked asked>
  HWY_INLINE void add_plane(const Footprint<D>& f, V<D> g, V<D> grad_z, V<D> z, M<D> on_plane) {
    const auto inverse_w = hn::IfThenElseZero(on_plane, f.inverse_w);
    const auto u = hn::Mul(hn::IfThenElseZero(on_plane, f.nu), inverse_w);
    const auto v = hn::Mul(hn::IfThenElseZero(on_plane, f.nv), inverse_w);
    const auto gw = hn::Mul(g, inverse_w);
    const auto grad_nu = hn::Neg(hn::Mul(gw, u));
    const auto grad_nv = hn::Neg(hn::Mul(gw, v));
    auto grad_w = hn::Mul(gw, hn::MulAdd(u, u, hn::Mul(v, v)));
    if constexpr (asked != Asked::colour) {
      const auto zw = hn::Mul(grad_z, inverse_w);
      grad_w = hn::NegMulAdd(zw, z, grad_w);
      z_plane = hn::Add(zw, z_plane);
    }
    u_x = hn::MulAdd(grad_nu, f.x, u_x);
    u_y = hn::MulAdd(grad_nu, f.y, u_y);
    u_1 = hn::Add(grad_nu, u_1);
    v_x = hn::MulAdd(grad_nv, f.x, v_x);
    v_y = hn::MulAdd(grad_nv, f.y, v_y);
    v_1 = hn::Add(grad_nv, v_1);
    w_x = hn::MulAdd(grad_w, f.x, w_x);
    w_y = hn::MulAdd(grad_w, f.y, w_y);
    w_1 = hn::Add(grad_w, w_1);
  }

  // Sums every member over the lanes.
  HWY_INLINE void reduce(D d, float* to) const {
    const auto zero = hn::Zero(d);
    V<D> v[padded] = {u_x,  u_y,     u_1,      v_x,      v_y,      v_1,         w_x,  w_y,
                      w_1,  z_plane, centre_x, centre_y, z_centre, log_opacity, red,  green,
                      blue, tint,    normal_x, normal_y, normal_z, roughness,   zero, zero};
    const size_t count = add_crosswise(d, v);
    HWY_ALIGN float sums[padded + pixels_per_block];
    for (size_t i = 0; i < count; ++i) hn::StoreU(v[i], d, sums + i * hn::Lanes(d));
    std::copy(sums, sums + padded, to);
  }

 private:
  // Adds pairs of vectors crosswise into one vector, which halves the number of vectors and the lanes per
  // sum, until each sum has one lane. Returns how many vectors are left.
  HWY_INLINE static size_t add_crosswise([[maybe_unused]] D d, [[maybe_unused]] V<D>* v) {
    size_t count = padded;
#if HWY_TARGET != HWY_SCALAR
    if constexpr (hn::MaxLanes(D()) > 1) {
      for (size_t lanes = hn::Lanes(d); lanes > 1; lanes /= 2) {
        if (count % 2 != 0) v[count++] = hn::Zero(d);
        count /= 2;
        for (size_t i = 0; i < count; ++i) {
          v[i] = hn::Add(hn::ConcatEven(d, v[2 * i + 1], v[2 * i]), hn::ConcatOdd(d, v[2 * i + 1], v[2 * i]));
        }
      }
    }
#endif
    return count;
  }
};

template <Asked asked>
class TileUnblender {
 public:
  HWY_INLINE TileUnblender(const KernelOptions& o, const TileLists& lists, const SavedBlock* blocks,
                           const Saved& saved, TileState& state)
      : o_(o), lists_(lists), blocks_(blocks), saved_(saved), state_(state) {}

  HWY_INLINE void in_list_order() {
    const Pixels d;
    for (int block = 0; block < blocks_per_tile; ++block) {
      for (size_t lane = 0; lane < pixels_per_block; lane += hn::Lanes(d)) {
        const auto at = pixel_centres(d, lists_.block_x(block), lists_.block_y(block), lane);
        hn::Store(at.x, d, x_[block] + lane);
        hn::Store(at.y, d, y_[block] + lane);
      }
    }
    for (uint32_t place = lists_.count; place-- > 0;) {
      prefetch(place - prefetch_distance);
      const TileEntry entry = lists_.entries[place];
      const uint32_t touched = saved_.touched[entry.entry];
      if (touched != 0) add_surfel(entry, touched, place);
    }
  }

  HWY_INLINE void in_hit_order() {
    for (uint32_t place = 0; place < lists_.count; ++place) {
      saved_.scratch.gradients[lists_.entries[place].entry] = {};
    }
    SortedHits sorted;
    for (int block = 0; block < blocks_per_tile; ++block) {
      if ((lists_.blocks >> block & 1U) == 0) continue;
      sorted.collect(saved_, lists_, block, lists_.block_x(block), lists_.block_y(block));
      for (size_t i = 0; i < pixels_per_block; ++i) add_pixel(sorted.of_pixel[i], block, i);
    }
  }

 private:
  HWY_INLINE void prefetch(uint32_t place) const {
    if (place >= lists_.count) return;
    prefetch_splat(saved_, lists_, place);
    const uint32_t entry = lists_.entries[place].entry;
    hwy::Prefetch(&saved_.scratch.gradients[entry]);
    hwy::Prefetch(&saved_.scratch.gradients[entry].z_plane);
  }

  HWY_INLINE void add_surfel(const TileEntry& entry, uint32_t touched, uint32_t place) {
    const Pixels d;
    const Splat& splat = saved_.splats[entry.surfel];
    Sums<Pixels> sums(d);
    for (; touched != 0; touched &= touched - 1) {
      const int block = std::countr_zero(touched);
      for (size_t lane = 0; lane < pixels_per_block; lane += hn::Lanes(d)) {
        const PixelCentres<Pixels> at{hn::Load(d, x_[block] + lane), hn::Load(d, y_[block] + lane)};
        sums.template add<asked>(d, o_, splat, evaluate(d, saved_.rho_per_pixel2, splat, at), place,
                                 blocks_[block], lane, state_.blocks[block]);
      }
    }
    sums.reduce(d, &saved_.scratch.gradients[entry.entry].u_x);
  }

  HWY_INLINE void add_pixel(const std::vector<SortedHits::Hit>& hits, int block, size_t lane) {
    const OnePixel d;
    const auto at = pixel_centres(d, lists_.block_x(block), lists_.block_y(block), lane);
    for (auto place = static_cast<uint32_t>(blocks_[block].last[lane] + 1); place-- > 0;) {
      const TileEntry entry = lists_.entries[hits[place].place];
      const Splat& splat = saved_.splats[entry.surfel];
      Sums<OnePixel> sums(d);
      sums.template add<asked>(d, o_, splat, evaluate(d, saved_.rho_per_pixel2, splat, at), place,
                               blocks_[block], lane, state_.blocks[block]);
      float values[Sums<OnePixel>::padded];
      sums.reduce(d, values);
      float* const to = &saved_.scratch.gradients[entry.entry].u_x;
      for (int i = 0; i < Sums<OnePixel>::used; ++i) to[i] += values[i];
    }
  }

  const KernelOptions& o_;
  const TileLists& lists_;
  const SavedBlock* blocks_;
  const Saved& saved_;
  TileState& state_;
  alignas(64) float x_[blocks_per_tile][pixels_per_block];  // pixel centres
  alignas(64) float y_[blocks_per_tile][pixels_per_block];
};

template <Asked asked>
HWY_INLINE void blend_backward(SortOrder order, const KernelOptions& o, const TileLists& lists,
                               const SavedBlock* blocks, const Saved& saved, TileState& state) {
  TileUnblender<asked> tile(o, lists, blocks, saved, state);
  if (order == SortOrder::centre) {
    tile.in_list_order();
  } else {
    tile.in_hit_order();
  }
}

void blend_backward_tile(SortOrder order, const KernelOptions& o, int64_t index, TileMemory& memory,
                         const Saved& saved, const OutputGradient& grad_output) {
  const TileLists lists =
      order == SortOrder::centre ? tile_entries(saved, index) : tile_lists(saved, index, memory);
  const SavedBlock* const blocks = &saved.blocks[index * blocks_per_tile];
  TileState state;
  for (int block = 0; block < blocks_per_tile; ++block) {
    load_block(grad_output, o.background, lists.block_x(block), lists.block_y(block), saved.width,
               saved.height, blocks[block], state.blocks[block]);
  }
  const Asked asked_outputs = asked_by(grad_output);
  if (asked_outputs == Asked::all) {
    blend_backward<Asked::all>(order, o, lists, blocks, saved, state);
  } else if (asked_outputs == Asked::geometry) {
    blend_backward<Asked::geometry>(order, o, lists, blocks, saved, state);
  } else {
    blend_backward<Asked::colour>(order, o, lists, blocks, saved, state);
  }
}

}  // namespace traceflow::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace traceflow::raster {

HWY_EXPORT(blend_backward_tile);

void blend_backward(const Options& options, const Saved& saved, const OutputGradient& grad_output) {
  saved.scratch.gradients.resize({saved.entries.size()});
  const KernelOptions kernel_options(options);
  const auto blend_backward_one = HWY_DYNAMIC_DISPATCH(blend_backward_tile);
  parallel_blocks("raster: blend backward", saved.tiles(), 1, [&](int64_t tile, int64_t) {
    static thread_local TileMemory memory;
    blend_backward_one(options.sort, kernel_options, tile, memory, saved, grad_output);
  });
}

}  // namespace traceflow::raster
#endif
