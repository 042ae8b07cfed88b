#include <cstring>

#include "base/parallel.h"
#include "ops/raster/raster_kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "ops/raster/cpu/backward.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "ops/raster/cpu/simd-inl.h"
#include "ops/raster/hit_gradient-inl.h"

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

// The arithmetic of hit_gradient-inl.h on vectors.
template <class D>
struct Lanes {
  [[no_unique_address]] D d;
  size_t lane;  // of the block: the first pixel of the vector

  HWY_INLINE V<D> at(const float* of_block) const { return hn::LoadU(d, of_block + lane); }
  HWY_INLINE V<D> set(float x) const { return hn::Set(d, x); }
  HWY_INLINE V<D> add(V<D> a, V<D> b) const { return hn::Add(a, b); }
  HWY_INLINE V<D> sub(V<D> a, V<D> b) const { return hn::Sub(a, b); }
  HWY_INLINE V<D> mul(V<D> a, V<D> b) const { return hn::Mul(a, b); }
  HWY_INLINE V<D> neg(V<D> a) const { return hn::Neg(a); }
  HWY_INLINE V<D> mul_add(V<D> a, V<D> b, V<D> c) const { return hn::MulAdd(a, b, c); }
  HWY_INLINE V<D> neg_mul_add(V<D> a, V<D> b, V<D> c) const { return hn::NegMulAdd(a, b, c); }
  HWY_INLINE M<D> less(V<D> a, V<D> b) const { return hn::Lt(a, b); }
  HWY_INLINE M<D> both(M<D> a, M<D> b) const { return hn::And(a, b); }
  HWY_INLINE V<D> zero_unless(M<D> mask, V<D> a) const { return hn::IfThenElseZero(mask, a); }
  HWY_INLINE V<D> zero_if(M<D> mask, V<D> a) const { return hn::IfThenZeroElse(mask, a); }
  // A branch would cost more than it saves.
  HWY_INLINE bool may_hold(M<D>) const { return true; }
  HWY_INLINE bool may_fail(M<D>) const { return true; }
  HWY_INLINE V<D> z(const Footprint<D>& f, const Splat& s) const { return f.z(d, s); }
  HWY_INLINE V<D> inverse_z(const Footprint<D>& f, const Splat& s) const { return f.inverse_z(d, s); }
};

// The sums of a surfel over pixels, one per lane.
template <class D>
struct Sums : BasicSplatGradient<V<D>> {
  static constexpr int used = 22;
  static constexpr int padded = 24;
  static_assert(sizeof(SplatGradient) == padded * sizeof(float));

  HWY_INLINE explicit Sums(D d) {
    V<D>* const first = &this->u_x;
    for (int i = 0; i < padded; ++i) first[i] = hn::Zero(d);
  }

  // Adds one hit per lane and moves the state in front of it.
  template <Asked asked>
  HWY_INLINE void add(D d, const KernelOptions& o, const Splat& s, const Footprint<D>& f, uint32_t place,
                      const SavedBlock& saved, size_t lane, BlockState& state) {
    const Int<D> di;
    const Lanes<D> l{d, lane};
    const auto here = hn::Set(di, static_cast<int32_t>(place));
    const auto is_blended = hn::Not(hn::Lt(hn::LoadU(di, saved.last + lane), here));
    const auto hit = hn::And(f.inside, hn::RebindMask(d, is_blended));
    const auto is_median = hn::RebindMask(d, hn::Eq(hn::LoadU(di, saved.median + lane), here));
    const auto alpha = hn::IfThenElseZero(hit, hn::Min(f.opacity, l.set(o.alpha_max)));
    const auto past = reciprocal(d, hn::Sub(l.set(1.0F), alpha));
    const auto transmittance_behind = l.at(state.transmittance);
    const auto transmittance = hn::IfThenElse(hit, hn::Mul(transmittance_behind, past), transmittance_behind);
    const auto weight = hn::Mul(alpha, transmittance);
    const auto own = grad_weight<asked>(l, o, s, f, state, saved);
    const auto behind = l.at(state.behind);
    const auto grad_alpha = hn::NegMulAdd(behind, past, hn::Mul(transmittance, own));
    hn::StoreU(hn::MulAdd(weight, own, behind), d, state.behind + lane);
    hn::StoreU(transmittance, d, state.transmittance + lane);
    add_hit<asked>(l, o, s, f, state, saved, weight, grad_alpha, hit, hn::And(hit, is_median), *this);
  }

  // Sums every member over the lanes.
  HWY_INLINE void reduce(D d, float* to) const {
    V<D> v[padded];
    std::copy(&this->u_x, &this->u_x + padded, v);
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
