// Shared definitions of the vector kernels of the fast path. Compiled once per instruction set, so there is
// no ordinary include guard.
#if defined(TRACEFLOW_RASTER_SIMD_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef TRACEFLOW_RASTER_SIMD_INL_H
#undef TRACEFLOW_RASTER_SIMD_INL_H
#else
#define TRACEFLOW_RASTER_SIMD_INL_H
#endif

#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <vector>

#include "ops/raster/raster_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace traceflow::raster::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// As many pixels of a block (16) as fit in a vector.
using Pixels = hn::CappedTag<float, pixels_per_block>;
using OnePixel = hn::CappedTag<float, 1>;

template <class D>
using V = hn::Vec<D>;
template <class D>
using M = hn::Mask<D>;
template <class D>
using Int = hn::RebindToSigned<D>;

// 1/x, accurate to one or two units in the last place.
template <class D>
HWY_INLINE V<D> reciprocal(D d, V<D> x) {
  const auto guess = hn::ApproximateReciprocal(x);
  return hn::Mul(guess, hn::NegMulAdd(x, guess, hn::Set(d, 2.0F)));
}

// 2^x for -126 < x < 127, with a relative error of 2e-7. The result is unspecified for other x.
template <class D>
HWY_INLINE V<D> exp2(D d, V<D> x) {
  const Int<D> di;
  // Adding 1.5·2^23 leaves the nearest integer in the low bits.
  const auto magic = hn::Set(d, 12582912.0F);
  const auto shifted = hn::Add(x, magic);
  const auto f = hn::Sub(x, hn::Sub(shifted, magic));
  auto p = hn::Set(d, 0.00132764719F);
  p = hn::MulAdd(p, f, hn::Set(d, 0.00967554133F));
  p = hn::MulAdd(p, f, hn::Set(d, 0.0555071327F));
  p = hn::MulAdd(p, f, hn::Set(d, 0.240221197F));
  p = hn::MulAdd(p, f, hn::Set(d, 0.693146967F));
  p = hn::MulAdd(p, f, hn::Set(d, 1.00000007F));
  return hn::BitCast(d, hn::Add(hn::BitCast(di, p), hn::ShiftLeft<23>(hn::BitCast(di, shifted))));
}

// A surfel at the pixels of a vector (method §3.1, §3.2). If `inside` is false, z is still finite, but u and
// v may be anything.
template <class D>
struct Footprint {
  V<D> x, y;       // pixels from the anchor
  V<D> dx, dy;     // pixels from the projected centre
  V<D> nu, nv, w;  // u = nu/w, v = nv/w
  V<D> inverse_w;
  V<D> opacity;   // o·G before the clamp
  M<D> on_plane;  // the hit in the plane wins over the low-pass
  M<D> inside;    // o·G ≥ alpha_min

  HWY_INLINE V<D> z(D d, const Splat& s) const {
    return hn::IfThenElse(on_plane, hn::Mul(hn::Set(d, s.z_plane), inverse_w), hn::Set(d, s.z_centre));
  }
  HWY_INLINE V<D> inverse_z(D d, const Splat& s) const {
    return hn::IfThenElse(on_plane, hn::Mul(hn::Set(d, s.inverse_z_plane), w),
                          hn::Set(d, s.inverse_z_centre));
  }
};

// Centres of the pixels of a block, from pixel `lane` on. (x, y) is the upper left corner of the block.
template <class D>
struct PixelCentres {
  V<D> x, y;
};
template <class D>
HWY_INLINE PixelCentres<D> pixel_centres(D d, int x, int y, size_t lane) {
  const Int<D> di;
  const auto i = hn::Add(hn::Iota(di, static_cast<int32_t>(lane)), hn::Zero(di));
  const auto column = hn::And(i, hn::Set(di, block_edge - 1));
  const auto row = hn::ShiftRight<2>(i);
  const auto half = hn::Set(d, 0.5F);
  return {hn::Add(hn::ConvertTo(d, hn::Add(column, hn::Set(di, x))), half),
          hn::Add(hn::ConvertTo(d, hn::Add(row, hn::Set(di, y))), half)};
}

// Evaluates `count` pairs of a splat and a vector of pixels together. A pair is a long chain of dependent
// operations; doing each step for all pairs overlaps the chains.
template <size_t count, class D>
HWY_INLINE void evaluate(D d, float rho_per_pixel2, const Splat* const* splats, const PixelCentres<D>* at,
                         Footprint<D>* footprints) {
  const auto set = [d](float x) HWY_ATTR { return hn::Set(d, x); };
  V<D> rho_screen[count];
  V<D> rho[count];
  for (size_t i = 0; i < count; ++i) {
    const Splat& s = *splats[i];
    Footprint<D>& f = footprints[i];
    f.x = hn::Sub(at[i].x, set(s.anchor_x));
    f.y = hn::Sub(at[i].y, set(s.anchor_y));
    f.w = hn::MulAdd(set(s.w_x), f.x, hn::MulAdd(set(s.w_y), f.y, set(s.w_1)));
    f.inverse_w = reciprocal(d, f.w);
  }
  for (size_t i = 0; i < count; ++i) {
    const Splat& s = *splats[i];
    Footprint<D>& f = footprints[i];
    f.nu = hn::MulAdd(set(s.u_x), f.x, hn::MulAdd(set(s.u_y), f.y, set(s.u_1)));
    f.nv = hn::MulAdd(set(s.v_x), f.x, hn::MulAdd(set(s.v_y), f.y, set(s.v_1)));
    f.dx = hn::Sub(f.x, set(s.centre_x));
    f.dy = hn::Sub(f.y, set(s.centre_y));
    rho_screen[i] = hn::Mul(set(rho_per_pixel2), hn::MulAdd(f.dx, f.dx, hn::Mul(f.dy, f.dy)));
  }
  for (size_t i = 0; i < count; ++i) {
    const Splat& s = *splats[i];
    Footprint<D>& f = footprints[i];
    const auto rho_max = set(s.rho_max);
    const auto rho_plane =
        hn::Mul(hn::MulAdd(f.nu, f.nu, hn::Mul(f.nv, f.nv)), hn::Mul(f.inverse_w, f.inverse_w));
    const auto in_front = hn::And(hn::Gt(f.w, hn::Zero(d)), hn::Le(f.w, set(s.w_max)));
    f.on_plane = hn::And(in_front, hn::Le(rho_plane, hn::Min(rho_screen[i], rho_max)));
    rho[i] = hn::IfThenElse(f.on_plane, rho_plane, rho_screen[i]);
    f.inside = hn::Le(rho[i], rho_max);
  }
  for (size_t i = 0; i < count; ++i) {
    footprints[i].opacity = exp2(d, hn::MulAdd(rho[i], set(-0.72134752F), set(splats[i]->log2_opacity)));
  }
}

template <class D>
HWY_INLINE Footprint<D> evaluate(D d, float rho_per_pixel2, const Splat& splat, const PixelCentres<D>& at) {
  const Splat* const splats[] = {&splat};
  Footprint<D> f;
  evaluate<1>(d, rho_per_pixel2, splats, &at, &f);
  return f;
}

// The blocks of a tile in which a splat may cover a pixel, as bits. Exact for the ellipse and the low-pass
// disk against the square of each block's pixel centres, up to a margin for rounding.
HWY_INLINE uint32_t reached_blocks(const Splat& s, float rho_per_pixel2, int tile_x, int tile_y) {
  if (s.ellipse_x != s.ellipse_x) return 0xffff;
  const Pixels d;
  const Int<Pixels> di;
  const auto set = [d](float x) HWY_ATTR { return hn::Set(d, x); };
  const auto clamp = [](auto x, auto low, auto high) HWY_ATTR { return hn::Min(hn::Max(x, low), high); };
  constexpr float margin = 0.01F;
  const auto rho = set(s.rho_max * 1.002F + 0.02F);
  const auto inside = [&](auto x, auto y) HWY_ATTR {
    const auto nu = hn::MulAdd(set(s.u_x), x, hn::MulAdd(set(s.u_y), y, set(s.u_1)));
    const auto nv = hn::MulAdd(set(s.v_x), x, hn::MulAdd(set(s.v_y), y, set(s.v_1)));
    const auto w = hn::MulAdd(set(s.w_x), x, hn::MulAdd(set(s.w_y), y, set(s.w_1)));
    return hn::Le(hn::MulAdd(nu, nu, hn::Mul(nv, nv)), hn::Mul(rho, hn::Mul(w, w)));
  };
  const auto first_x = set(static_cast<float>(tile_x) + 0.5F - margin - s.anchor_x);
  const auto first_y = set(static_cast<float>(tile_y) + 0.5F - margin - s.anchor_y);
  const auto span = set(block_edge - 1 + 2 * margin);
  uint32_t reached = 0;
  for (size_t b = 0; b < blocks_per_tile; b += hn::Lanes(d)) {
    const auto block = hn::Add(hn::Iota(di, static_cast<int32_t>(b)), hn::Zero(di));
    const auto column = hn::ConvertTo(d, hn::And(block, hn::Set(di, blocks_per_row - 1)));
    const auto row = hn::ConvertTo(d, hn::ShiftRight<2>(block));
    const auto low_x = hn::MulAdd(column, set(block_edge), first_x);
    const auto low_y = hn::MulAdd(row, set(block_edge), first_y);
    const auto high_x = hn::Add(low_x, span);
    const auto high_y = hn::Add(low_y, span);
    // In a rectangle, the minimum of the convex form is on the sides that face its centre.
    const auto centre_x = set(s.ellipse_x);
    const auto centre_y = set(s.ellipse_y);
    const auto side_x = clamp(centre_x, low_x, high_x);
    const auto side_y = clamp(centre_y, low_y, high_y);
    const auto on_side_x = hn::MulAdd(set(s.slope_y), hn::Sub(side_x, centre_x), centre_y);
    const auto on_side_y = hn::MulAdd(set(s.slope_x), hn::Sub(side_y, centre_y), centre_x);
    const auto ellipse = hn::Or(inside(side_x, clamp(on_side_x, low_y, high_y)),
                                inside(clamp(on_side_y, low_x, high_x), side_y));
    const auto dx = hn::Sub(clamp(set(s.centre_x), low_x, high_x), set(s.centre_x));
    const auto dy = hn::Sub(clamp(set(s.centre_y), low_y, high_y), set(s.centre_y));
    const auto disk = hn::Le(hn::Mul(set(rho_per_pixel2), hn::MulAdd(dx, dx, hn::Mul(dy, dy))), rho);
    uint8_t bits[8] = {};
    hn::StoreMaskBits(d, hn::Or(ellipse, disk), bits);
    reached |= (uint32_t{bits[0]} | uint32_t{bits[1]} << 8) << b;
  }
  return reached;
}

// A tile of the image, its list, and for each of its blocks the indices in the list that the block processes.
struct TileLists {
  int x, y;                  // upper left pixel
  const TileEntry* entries;  // front to back
  uint32_t count;
  uint32_t blocks;  // blocks inside the image, as bits
  const uint32_t* of_block[blocks_per_tile];
  uint32_t counts[blocks_per_tile];

  int block_x(int block) const { return x + block % blocks_per_row * block_edge; }
  int block_y(int block) const { return y + block / blocks_per_row * block_edge; }
};

// Returns the tile without the lists of its blocks.
HWY_INLINE TileLists tile_entries(const Saved& saved, int64_t tile) {
  TileLists lists{};
  lists.x = static_cast<int>(tile % saved.tile_columns) * tile_edge;
  lists.y = static_cast<int>(tile / saved.tile_columns) * tile_edge;
  lists.entries = saved.entries.data() + saved.tile_begin[tile];
  lists.count = saved.tile_begin[tile + 1] - saved.tile_begin[tile];
  for (int b = 0; b < blocks_per_tile; ++b) {
    if (lists.block_x(b) < saved.width && lists.block_y(b) < saved.height) lists.blocks |= 1U << b;
  }
  return lists;
}

// Splats are prefetched this many elements ahead in the list.
constexpr uint32_t prefetch_distance = 6;
HWY_INLINE void prefetch_splat(const Saved& saved, const TileLists& lists, uint32_t place) {
  if (place >= lists.count) return;
  const Splat* const splat = &saved.splats[lists.entries[place].surfel];
  hwy::Prefetch(splat);
  hwy::Prefetch(reinterpret_cast<const char*>(splat) + sizeof(Splat) / 2);
}

// Appends the indices in [0, count) for which `bit` is set in `reached`, without a branch per index. The
// output must have room for one more vector.
HWY_INLINE uint32_t* append_reached(const uint32_t* reached, uint32_t count, uint32_t bit, uint32_t* to) {
  const hn::ScalableTag<uint32_t> d;
  const auto wanted = hn::Set(d, bit);
  for (uint32_t place = 0; place < count; place += static_cast<uint32_t>(hn::Lanes(d))) {
    const auto has = hn::TestBit(hn::LoadU(d, reached + place), wanted);
    hn::StoreU(hn::Compress(hn::Iota(d, place), has), d, to);
    to += hn::CountTrue(d, has);
  }
  return to;
}

HWY_INLINE TileLists tile_lists(const Saved& saved, int64_t tile, TileMemory& memory) {
  constexpr int64_t padding = HWY_MAX_BYTES / sizeof(uint32_t);
  TileLists lists = tile_entries(saved, tile);
  memory.reached.resize({lists.count + padding});
  memory.places.resize({blocks_per_tile * (lists.count + padding)});
  uint32_t* const reached = memory.reached.data();
  for (uint32_t place = 0; place < lists.count; ++place) {
    prefetch_splat(saved, lists, place + prefetch_distance);
    reached[place] =
        reached_blocks(saved.splats[lists.entries[place].surfel], saved.rho_per_pixel2, lists.x, lists.y);
  }
  std::fill_n(reached + lists.count, padding, 0U);
  for (int b = 0; b < blocks_per_tile; ++b) {
    if ((lists.blocks >> b & 1U) == 0) continue;
    uint32_t* const begin = memory.places.data() + b * (lists.count + padding);
    lists.of_block[b] = begin;
    lists.counts[b] = static_cast<uint32_t>(append_reached(reached, lists.count, 1U << b, begin) - begin);
  }
  return lists;
}

// For sort = hit: the hits of each pixel of a block, front to back.
struct SortedHits {
  struct Hit {
    float z;
    uint32_t place;
  };
  std::vector<Hit> of_pixel[pixels_per_block];

  HWY_INLINE void collect(const Saved& saved, const TileLists& lists, int block, int x, int y) {
    const Pixels d;
    for (auto& hits : of_pixel) hits.clear();
    for (size_t lane = 0; lane < pixels_per_block; lane += hn::Lanes(d)) {
      const auto at = pixel_centres(d, x, y, lane);
      for (uint32_t i = 0; i < lists.counts[block]; ++i) {
        const uint32_t place = lists.of_block[block][i];
        const Splat& splat = saved.splats[lists.entries[place].surfel];
        const auto f = evaluate(d, saved.rho_per_pixel2, splat, at);
        HWY_ALIGN float z[pixels_per_block];
        HWY_ALIGN float inside[pixels_per_block];
        hn::Store(f.z(d, splat), d, z);
        hn::Store(hn::IfThenElseZero(f.inside, hn::Set(d, 1.0F)), d, inside);
        for (size_t j = 0; j < hn::Lanes(d); ++j) {
          if (inside[j] != 0) of_pixel[lane + j].push_back({z[j], place});
        }
      }
    }
    for (auto& hits : of_pixel) {
      std::sort(hits.begin(), hits.end(),
                [](const Hit& a, const Hit& b) { return a.z != b.z ? a.z < b.z : a.place < b.place; });
    }
  }
};

}  // namespace traceflow::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
