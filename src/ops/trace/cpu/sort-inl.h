// Sorts the hits of one ray. Compiled once per target.
#if defined(TRACEFLOW_TRACE_SORT_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef TRACEFLOW_TRACE_SORT_INL_H
#undef TRACEFLOW_TRACE_SORT_INL_H
#else
#define TRACEFLOW_TRACE_SORT_INL_H
#endif

#include <hwy/highway.h>

#include "math/blend.h"
#include "ops/trace/cpu/tree-inl.h"
#include "ops/trace/trace_hits.h"

HWY_BEFORE_NAMESPACE();
namespace traceflow::trace::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Counts the hits that are nearer than each hit in `vectors` vectors from `first` on.
template <size_t vectors>
HWY_INLINE void count_nearer(const Hits& hits, size_t first, uint32_t* HWY_RESTRICT rank) {
  const Tag d;
  const hn::RebindToSigned<Tag> di;
  const auto one = hn::Set(di, 1);
  const size_t lanes = hn::Lanes(d);
  Vec own[vectors];
  hn::Vec<decltype(di)> sum[vectors];
  for (size_t k = 0; k < vectors; ++k) {
    own[k] = hn::LoadU(d, hits.distance + first + k * lanes);
    sum[k] = hn::Zero(di);
  }
  for (size_t j = 0; j < hits.count; ++j) {
    const Vec other = hn::Set(d, hits.distance[j]);
    for (size_t k = 0; k < vectors; ++k) {
      const auto nearer = hn::RebindMask(di, hn::Lt(other, own[k]));
      sum[k] = hn::IfThenElse(nearer, hn::Add(sum[k], one), sum[k]);
    }
  }
  for (size_t k = 0; k < vectors; ++k) {
    hn::StoreU(sum[k], di, reinterpret_cast<int32_t*>(rank + first + k * lanes));
  }
}

HWY_NOINLINE inline void rank_hits(const Hits& hits, uint32_t* HWY_RESTRICT rank) {
  const size_t lanes = hn::Lanes(Tag());
  for (size_t first = 0; first < hits.count; first += 4 * lanes) {
    const size_t left = hits.count - first;
    if (left <= lanes) {
      count_nearer<1>(hits, first, rank);
    } else if (left <= 2 * lanes) {
      count_nearer<2>(hits, first, rank);
    } else if (left <= 3 * lanes) {
      count_nearer<3>(hits, first, rank);
    } else {
      count_nearer<4>(hits, first, rank);
    }
  }
}

// Sorts by distance, ties by surfel. `names` maps the `surfel` of a hit to a surfel; null if hits store
// surfels.
HWY_INLINE void sort_hits(Hits& hits, HitSorter& sorter, const uint32_t* names = nullptr) {
  if (hits.count > HitSorter::most_ranked) {
    sorter.sort_many(hits, names);
    return;
  }
  uint32_t rank[HitSorter::most_ranked + bvh_width];
  rank_hits(hits, rank);
  if (!sorter.place(rank, hits)) sorter.sort_many(hits, names);
}

// Drops the hits behind the one at which the ray ends. That hit stays, because more hits in front can only
// end the ray sooner. Returns its distance, or `far` if the ray does not end. `transmittance`: what remains
// behind the hits.
inline float cut_hits(const BlendRules<float>& rules, Hits& hits, float far, float& transmittance) {
  transmittance = 1;
  for (size_t i = 0; i < hits.count; ++i) {
    const bool ends = blend_ends(rules, transmittance, hits.alpha[i]);
    transmittance *= 1 - hits.alpha[i];
    if (!ends) continue;
    hits.count = i + 1;
    return hits.distance[i];
  }
  return far;
}

}  // namespace traceflow::trace::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
