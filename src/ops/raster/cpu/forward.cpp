#include <type_traits>

#include "base/parallel.h"
#include "ops/raster/raster_kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "ops/raster/cpu/forward.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "ops/raster/cpu/simd-inl.h"

// Blends the tiles front to back (method §3.3, §3.5). A tile is one task of one thread. In a tile, each block
// of pixels processes its list independently, with its sums in registers, until all of its pixels are opaque.
HWY_BEFORE_NAMESPACE();
namespace traceflow::raster::HWY_NAMESPACE {

// The sums of a block of pixels that backward does not need.
struct BlockSums {
  alignas(64) float colour[3][pixels_per_block];
  alignas(64) float normal[3][pixels_per_block];
  alignas(64) float tint[pixels_per_block];
  alignas(64) float silhouette[pixels_per_block];
  alignas(64) float roughness[pixels_per_block];
  alignas(64) float median_depth[pixels_per_block];
  alignas(64) float distortion[pixels_per_block];
};

// The state of the pixels of one vector.
template <class D>
class Blend {
 public:
  HWY_INLINE Blend(D d, M<D> live)
      : live_(live),
        transmittance_(hn::Set(d, 1.0F)),
        alpha_(hn::Zero(d)),
        red_(hn::Zero(d)),
        green_(hn::Zero(d)),
        blue_(hn::Zero(d)),
        tint_(hn::Zero(d)),
        silhouette_(hn::Zero(d)),
        roughness_(hn::Zero(d)),
        normal_x_(hn::Zero(d)),
        normal_y_(hn::Zero(d)),
        normal_z_(hn::Zero(d)),
        depth_(hn::Zero(d)),
        m_(hn::Zero(d)),
        m2_(hn::Zero(d)),
        first_inverse_z_(hn::Zero(d)),
        median_depth_(hn::Zero(d)),
        next_(hn::Zero(Int<D>())),
        last_(hn::Set(Int<D>(), -1)),
        median_(hn::Set(Int<D>(), -1)) {}

  HWY_INLINE bool is_live(D d) const { return !hn::AllFalse(d, live_); }

  // Blends the next hit of the list. Returns whether any pixel blended it.
  HWY_INLINE bool add(D d, const KernelOptions& o, const Splat& s, const Footprint<D>& f) {
    const Int<D> di;
    const auto set = [d](float x) HWY_ATTR { return hn::Set(d, x); };
    const auto one = set(1.0F);
    auto hit = hn::And(f.inside, live_);
    auto weight = hn::Mul(transmittance_, hn::Min(f.opacity, set(o.alpha_max)));
    const auto ends = hn::And(hit, hn::Lt(hn::Sub(transmittance_, weight), set(o.transmittance_min)));
    live_ = hn::AndNot(ends, live_);
    hit = hn::AndNot(ends, hit);
    weight = hn::IfThenElseZero(hit, weight);

    const auto z = f.z(d, s);
    const auto inverse_z = f.inverse_z(d, s);
    const auto is_first = hn::And(hit, hn::Eq(transmittance_, one));
    first_inverse_z_ = hn::IfThenElse(is_first, inverse_z, first_inverse_z_);
    const auto m = hn::Sub(first_inverse_z_, inverse_z);
    const auto wm = hn::Mul(weight, m);
    m_ = hn::Add(m_, wm);
    m2_ = hn::MulAdd(wm, m, m2_);
    // The median hit is the last one that starts with a transmittance above one half. There is none if the
    // transmittance never falls to one half.
    const auto may_be_median = hn::And(hit, hn::Gt(transmittance_, set(0.5F)));
    median_depth_ = hn::IfThenElse(may_be_median, z, median_depth_);
    median_ = hn::IfThenElse(hn::RebindMask(di, may_be_median), next_, median_);
    last_ = hn::IfThenElse(hn::RebindMask(di, hit), next_, last_);
    next_ = hn::Add(next_, hn::Set(di, 1));

    alpha_ = hn::Add(alpha_, weight);
    red_ = hn::MulAdd(weight, set(s.colour[0]), red_);
    green_ = hn::MulAdd(weight, set(s.colour[1]), green_);
    blue_ = hn::MulAdd(weight, set(s.colour[2]), blue_);
    tint_ = hn::MulAdd(weight, set(s.tint), tint_);
    silhouette_ = hn::MulAdd(weight, set(s.in_body()), silhouette_);
    roughness_ = hn::MulAdd(weight, set(s.roughness()), roughness_);
    normal_x_ = hn::MulAdd(weight, set(s.normal[0]), normal_x_);
    normal_y_ = hn::MulAdd(weight, set(s.normal[1]), normal_y_);
    normal_z_ = hn::MulAdd(weight, set(s.normal[2]), normal_z_);
    depth_ = hn::MulAdd(weight, z, depth_);
    transmittance_ = hn::Sub(transmittance_, weight);
    return !hn::AllFalse(d, hit);
  }

  HWY_INLINE void store(D d, const KernelOptions& o, size_t lane, SavedBlock& saved, BlockSums& sums) const {
    const Int<D> di;
    const auto colour = [&](V<D> sum, float background)
                            HWY_ATTR { return hn::MulAdd(transmittance_, hn::Set(d, background), sum); };
    const auto has_median = hn::Le(transmittance_, hn::Set(d, 0.5F));
    const auto is_hit = hn::Gt(alpha_, hn::Zero(d));
    hn::StoreU(colour(red_, o.background.x), d, sums.colour[0] + lane);
    hn::StoreU(colour(green_, o.background.y), d, sums.colour[1] + lane);
    hn::StoreU(colour(blue_, o.background.z), d, sums.colour[2] + lane);
    hn::StoreU(normal_x_, d, sums.normal[0] + lane);
    hn::StoreU(normal_y_, d, sums.normal[1] + lane);
    hn::StoreU(normal_z_, d, sums.normal[2] + lane);
    hn::StoreU(tint_, d, sums.tint + lane);
    hn::StoreU(silhouette_, d, sums.silhouette + lane);
    hn::StoreU(roughness_, d, sums.roughness + lane);
    hn::StoreU(hn::IfThenElseZero(has_median, median_depth_), d, sums.median_depth + lane);
    hn::StoreU(transmittance_, d, saved.transmittance + lane);
    hn::StoreU(alpha_, d, saved.alpha + lane);
    hn::StoreU(hn::IfThenElseZero(is_hit, hn::Div(depth_, alpha_)), d, saved.depth + lane);
    // Σ over pairs of w_i w_j (m_i - m_j)² = A M2 - M1²
    const auto m_scale = hn::Set(d, o.m_scale);
    const auto m = hn::Mul(m_scale, m_);
    const auto m2 = hn::Mul(hn::Mul(m_scale, m_scale), m2_);
    const auto distortion = hn::NegMulAdd(m, m, hn::Mul(alpha_, m2));
    hn::StoreU(hn::Max(distortion, hn::Zero(d)), d, sums.distortion + lane);
    hn::StoreU(m, d, saved.m + lane);
    hn::StoreU(m2, d, saved.m2 + lane);
    hn::StoreU(first_inverse_z_, d, saved.inverse_z + lane);
    hn::StoreU(last_, di, saved.last + lane);
    hn::StoreU(hn::IfThenElse(hn::RebindMask(di, has_median), median_, hn::Set(di, -1)), di,
               saved.median + lane);
  }

 private:
  M<D> live_;
  V<D> transmittance_, alpha_, red_, green_, blue_, tint_, silhouette_, roughness_;
  V<D> normal_x_, normal_y_, normal_z_, depth_, m_, m2_;
  V<D> first_inverse_z_, median_depth_;
  V<Int<D>> next_, last_, median_;  // indices in the list
};

// Writes one row of a block. A constant number of columns lets the compiler copy whole vectors.
template <class Columns>
HWY_INLINE void write_row(const SavedBlock& saved, const BlockSums& sums, int begin, int64_t pixel,
                          Columns columns, Output& output) {
  for (int i = 0; i < columns; ++i) {
    for (int c = 0; c < 3; ++c) output.colour[3 * (pixel + i) + c] = sums.colour[c][begin + i];
    for (int c = 0; c < 3; ++c) output.normal[3 * (pixel + i) + c] = sums.normal[c][begin + i];
  }
  const auto copy = [&](const float* from, Tensor<float>& to) {
    for (int i = 0; i < columns; ++i) to[pixel + i] = from[begin + i];
  };
  copy(saved.alpha, output.alpha);
  copy(sums.tint, output.tint);
  if (!output.silhouette.empty()) copy(sums.silhouette, output.silhouette);
  if (!output.roughness.empty()) copy(sums.roughness, output.roughness);
  copy(saved.depth, output.depth);
  copy(sums.median_depth, output.median_depth);
  copy(sums.distortion, output.distortion);
}

HWY_INLINE void write_block(const SavedBlock& saved, const BlockSums& sums, int block_x, int block_y,
                            int width, int height, Output& output) {
  const int rows = std::min(block_edge, height - block_y);
  const int columns = std::min(block_edge, width - block_x);
  for (int row = 0; row < rows; ++row) {
    const int64_t pixel = int64_t{block_y + row} * width + block_x;
    if (columns == block_edge) {
      write_row(saved, sums, row * block_edge, pixel, std::integral_constant<int, block_edge>(), output);
    } else {
      write_row(saved, sums, row * block_edge, pixel, columns, output);
    }
  }
}

// The number of surfels that a block evaluates at once, limited by the number of registers.
constexpr int side_by_side = HWY_TARGET <= HWY_AVX3 ? 4 : 2;

class TileBlender {
 public:
  HWY_INLINE TileBlender(const KernelOptions& o, const TileLists& lists, int64_t tile, Saved& saved)
      : o_(o), lists_(lists), tile_(tile), saved_(saved) {}

  HWY_INLINE void run(SortOrder order, Output& output) {
    SortedHits sorted;
    for (uint32_t place = 0; place < lists_.count; ++place) saved_.touched[lists_.entries[place].entry] = 0;
    for (int block = 0; block < blocks_per_tile; ++block) {
      if ((lists_.blocks >> block & 1U) == 0) continue;
      const int x = lists_.block_x(block);
      const int y = lists_.block_y(block);
      BlockSums sums;
      SavedBlock& left = saved_.blocks[tile_ * blocks_per_tile + block];
      if (order == SortOrder::centre) {
        for (size_t lane = 0; lane < pixels_per_block; lane += hn::Lanes(Pixels())) {
          in_list_order(block, x, y, lane, left, sums);
        }
      } else {
        sorted.collect(saved_, lists_, block, x, y);
        for (size_t i = 0; i < pixels_per_block; ++i)
          in_hit_order(sorted.of_pixel[i], block, x, y, i, left, sums);
      }
      write_block(left, sums, x, y, saved_.width, saved_.height, output);
    }
  }

 private:
  // Lanes inside the image.
  template <class D>
  HWY_INLINE M<D> live_lanes(D d, const PixelCentres<D>& at) const {
    return hn::And(hn::Lt(at.x, hn::Set(d, static_cast<float>(saved_.width))),
                   hn::Lt(at.y, hn::Set(d, static_cast<float>(saved_.height))));
  }

  HWY_INLINE void in_list_order(int block, int x, int y, size_t lane, SavedBlock& left, BlockSums& sums) {
    const Pixels d;
    const auto at = pixel_centres(d, x, y, lane);
    Blend<Pixels> blend(d, live_lanes(d, at));
    const uint32_t* places = lists_.of_block[block];
    const uint32_t* const end = places + lists_.counts[block];
    for (; end - places >= side_by_side && blend.is_live(d); places += side_by_side) {
      add_places<side_by_side>(d, places, block, at, blend);
    }
    for (; places != end && blend.is_live(d); ++places) add_places<1>(d, places, block, at, blend);
    blend.store(d, o_, lane, left, sums);
    for (size_t i = lane; i < lane + hn::Lanes(d); ++i) {
      if (left.last[i] >= 0) left.last[i] = static_cast<int32_t>(lists_.of_block[block][left.last[i]]);
      if (left.median[i] >= 0) left.median[i] = static_cast<int32_t>(lists_.of_block[block][left.median[i]]);
    }
  }

  template <size_t count>
  HWY_INLINE void add_places(Pixels d, const uint32_t* places, int block, const PixelCentres<Pixels>& at,
                             Blend<Pixels>& blend) {
    const Splat* splats[count];
    PixelCentres<Pixels> centres[count];
    Footprint<Pixels> footprints[count];
    for (size_t i = 0; i < count; ++i) {
      splats[i] = &saved_.splats[lists_.entries[places[i]].surfel];
      centres[i] = at;
    }
    evaluate<count>(d, saved_.rho_per_pixel2, splats, centres, footprints);
    for (size_t i = 0; i < count; ++i) {
      if (blend.add(d, o_, *splats[i], footprints[i])) touch(lists_.entries[places[i]], block);
    }
  }

  HWY_INLINE void in_hit_order(const std::vector<SortedHits::Hit>& hits, int block, int x, int y, size_t lane,
                               SavedBlock& left, BlockSums& sums) {
    const OnePixel d;
    const auto at = pixel_centres(d, x, y, lane);
    Blend<OnePixel> blend(d, live_lanes(d, at));
    for (uint32_t i = 0; i < hits.size() && blend.is_live(d); ++i) {
      const TileEntry entry = lists_.entries[hits[i].place];
      const Splat& splat = saved_.splats[entry.surfel];
      if (blend.add(d, o_, splat, evaluate(d, saved_.rho_per_pixel2, splat, at))) touch(entry, block);
    }
    blend.store(d, o_, lane, left, sums);
  }

  HWY_INLINE void touch(const TileEntry& entry, int block) {
    uint16_t& blocks = saved_.touched[entry.entry];
    blocks = static_cast<uint16_t>(blocks | 1U << block);
  }

  const KernelOptions& o_;
  const TileLists& lists_;
  int64_t tile_;
  Saved& saved_;
};

void blend_tile(SortOrder order, const KernelOptions& o, int64_t tile, TileMemory& memory, Saved& saved,
                Output& output) {
  const TileLists lists = tile_lists(saved, tile, memory);
  TileBlender(o, lists, tile, saved).run(order, output);
}

}  // namespace traceflow::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace traceflow::raster {

HWY_EXPORT(blend_tile);

void blend(const Options& options, Output& output, Saved& saved) {
  const Shape plane{saved.height, saved.width};
  const Shape vectors{saved.height, saved.width, 3};
  for (auto* tensor :
       {&output.alpha, &output.tint, &output.depth, &output.median_depth, &output.distortion}) {
    tensor->place(Device::cpu).resize(plane);
  }
  output.silhouette.place(Device::cpu).resize(saved.has_silhouette ? plane : Shape{0});
  output.roughness.place(Device::cpu).resize(saved.has_roughness ? plane : Shape{0});
  output.colour.place(Device::cpu).resize(vectors);
  output.normal.place(Device::cpu).resize(vectors);
  saved.touched.resize({saved.entries.size()});
  saved.blocks.resize({saved.tiles() * blocks_per_tile});
  const KernelOptions kernel_options(options);
  const auto blend_one = HWY_DYNAMIC_DISPATCH(blend_tile);
  parallel_blocks("raster: blend", saved.tiles(), 1, [&](int64_t tile, int64_t) {
    static thread_local TileMemory memory;
    blend_one(options.sort, kernel_options, tile, memory, saved, output);
  });
}

}  // namespace traceflow::raster
#endif
