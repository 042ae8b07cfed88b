// Finds all hits of one ray that can matter, several disks at a time. Compiled once per target.
#if defined(TRACEFLOW_TRACE_RAY_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef TRACEFLOW_TRACE_RAY_INL_H
#undef TRACEFLOW_TRACE_RAY_INL_H
#else
#define TRACEFLOW_TRACE_RAY_INL_H
#endif

#include <hwy/highway.h>

#include "ops/trace/cpu/disk-inl.h"
#include "ops/trace/cpu/sort-inl.h"
#include "ops/trace/cpu/tree-inl.h"

HWY_BEFORE_NAMESPACE();
namespace traceflow::trace::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Appends the hits with a leaf's disks that are not nearer than `rules.near` nor farther than `far`.
HWY_INLINE void intersect_leaf(const BvhLeaf& leaf, const UnitRay& ray, const DiskRules& rules, float far,
                               Hits& hits) {
  const Tag d;
  const hn::RebindToUnsigned<Tag> du;
  const RayVec r{hn::Set(d, ray.origin.x),    hn::Set(d, ray.origin.y),    hn::Set(d, ray.origin.z),
                 hn::Set(d, ray.direction.x), hn::Set(d, ray.direction.y), hn::Set(d, ray.direction.z),
                 hn::Set(d, ray.width)};
  for (size_t i = 0; i < bvh_width; i += hn::Lanes(d)) {
    const DiskHit hit = intersect_disk(
        r, rules, hn::Set(d, far), [&](const float* row) HWY_ATTR { return hn::Load(d, row + i); }, leaf);
    if (hn::AllFalse(d, hit.mask)) continue;
    const Vec alpha = disk_alpha(hit, rules);
    hits.reserve_more(bvh_width);
    const size_t n = hits.count;
    hn::StoreU(hn::Compress(hit.distance, hit.mask), d, hits.distance + n);
    hn::StoreU(hn::Compress(alpha, hit.mask), d, hits.alpha + n);
    hn::StoreU(hn::Compress(hn::Load(du, leaf.surfel + i), hn::RebindMask(du, hit.mask)), du,
               hits.surfel + n);
    hits.count = n + hn::CountTrue(d, hit.mask);
  }
}

// Finds all hits up to where the ray certainly ends, in order.
HWY_INLINE void find_hits(const Bvh& bvh, const UnitRay& ray, const DiskRules& rules, Hits& hits,
                          HitSorter& sorter) {
  hits.count = 0;
  float far = farthest_distance;
  float transmittance = 1;
  size_t looked = 0;
  Beam beam(&ray, 1);
  beam.slope = rules.deviations * ray.width;
  traverse_tree(bvh, BoxBeam(beam), far, [&](const BvhLeaf& leaf) HWY_ATTR {
    intersect_leaf(leaf, ray, rules, far, hits);
    if (hits.count - looked < rules.hits_per_look) return;
    for (; looked < hits.count; ++looked) transmittance *= 1 - hits.alpha[looked];
    if (transmittance >= rules.blend.transmittance_min) return;
    sort_hits(hits, sorter);
    far = cut_hits(rules.blend, hits, far, transmittance);
    looked = hits.count;
  });
  sort_hits(hits, sorter);
}

}  // namespace traceflow::trace::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
