// Sorts the hits of one ray. Compiled once per target.
#if defined(TRACEFLOW_TRACE_SORT_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef TRACEFLOW_TRACE_SORT_INL_H
#undef TRACEFLOW_TRACE_SORT_INL_H
#else
#define TRACEFLOW_TRACE_SORT_INL_H
#endif

#include <hwy/highway.h>

#include "math/blend.h"
#include "ops/trace/trace_hits.h"
#include "ops/trace/trace_tree-inl.h"

HWY_BEFORE_NAMESPACE();
namespace traceflow::trace::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Where each hit belongs when sorted by distance, those of equal distance in the order in which they came.
HWY_INLINE void rank_hits(const Hits& hits, uint32_t* HWY_RESTRICT rank) {
  const Tag d;
  const hn::RebindToSigned<Tag> di;
  const auto one = hn::Set(di, 1);
  const size_t lanes = hn::Lanes(d);
  for (size_t i = 0; i < hits.count; i += lanes) {
    const Vec own = hn::LoadU(d, hits.distance + i);
    auto sum = hn::Zero(di);
    size_t j = 0;
    for (; j < i; ++j) {
      const auto before = hn::RebindMask(di, hn::Le(hn::Set(d, hits.distance[j]), own));
      sum = hn::IfThenElse(before, hn::Add(sum, one), sum);
    }
    const auto lane = hn::Iota(di, static_cast<int>(i));
    for (; j < std::min(i + lanes, hits.count); ++j) {
      const Vec other = hn::Set(d, hits.distance[j]);
      const auto earlier = hn::Gt(lane, hn::Set(di, static_cast<int>(j)));
      const auto before = hn::Or(hn::RebindMask(di, hn::Lt(other, own)),
                                 hn::And(hn::RebindMask(di, hn::Eq(other, own)), earlier));
      sum = hn::IfThenElse(before, hn::Add(sum, one), sum);
    }
    for (; j < hits.count; ++j) {
      const auto before = hn::RebindMask(di, hn::Lt(hn::Set(d, hits.distance[j]), own));
      sum = hn::IfThenElse(before, hn::Add(sum, one), sum);
    }
    hn::StoreU(sum, di, reinterpret_cast<int32_t*>(rank + i));
  }
}

// Sorts by distance, then by surfel; `names` gives the surfel of what a hit names, null where hits name
// surfels.
HWY_INLINE void sort_hits(Hits& hits, HitSorter& sorter, const uint32_t* names = nullptr) {
  if (hits.count > HitSorter::most_ranked) {
    sorter.sort_many(hits, names);
    return;
  }
  uint32_t rank[HitSorter::most_ranked + bvh_width];
  rank_hits(hits, rank);
  sorter.place(rank, hits, names);
}

// Drops what lies behind the hit at which the ray ends. That hit stays: more hits in front can only end the
// ray sooner. Returns its distance, or `far` where the ray goes on; `transmittance` is what the hits leave.
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
