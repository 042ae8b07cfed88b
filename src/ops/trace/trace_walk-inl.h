// Finds all hits of one ray that can matter and sorts them. Compiled once per target.
#if defined(TRACEFLOW_TRACE_WALK_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef TRACEFLOW_TRACE_WALK_INL_H
#undef TRACEFLOW_TRACE_WALK_INL_H
#else
#define TRACEFLOW_TRACE_WALK_INL_H
#endif

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cstring>

#include "math/blend.h"
#include "ops/trace/trace_bvh.h"
#include "ops/trace/trace_hits.h"
#include "ops/trace/trace_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace traceflow::trace::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::CappedTag<float, bvh_width>;
using Vec = hn::Vec<Tag>;

HWY_INLINE Vec dot(Vec ax, Vec ay, Vec az, Vec bx, Vec by, Vec bz) {
  return hn::MulAdd(az, bz, hn::MulAdd(ay, by, hn::Mul(ax, bx)));
}

// A ray prepared for slabs. Two origins, moved apart by more than rounding can be, make every box a little
// wider.
struct BoxRay {
  float reciprocal[3];
  float near_origin[3], far_origin[3];
  bool backwards[3];

  explicit BoxRay(const UnitRay& ray) {
    const float reach = std::max({std::abs(ray.origin.x), std::abs(ray.origin.y), std::abs(ray.origin.z)});
    const float margin = 2e-6F * reach;
    for (int axis = 0; axis < 3; ++axis) {
      const float d = ray.direction[axis];
      backwards[axis] = std::signbit(d);
      reciprocal[axis] = std::copysign(1.0F, d) / std::max(std::abs(d), 1e-10F);
      const float sign = backwards[axis] ? -1.0F : 1.0F;
      near_origin[axis] = ray.origin[axis] + sign * margin;
      far_origin[axis] = ray.origin[axis] - sign * margin;
    }
  }
};

// Bit k: the ray meets the box of child k at a distance up to `far`. Where it does, near[k] is that distance.
HWY_INLINE uint32_t meet_boxes(const BvhNode& node, const BoxRay& ray, float far, float* HWY_RESTRICT near) {
  const Tag d;
  uint32_t bits = 0;
  for (size_t i = 0; i < bvh_width; i += hn::Lanes(d)) {
    Vec enter = hn::Zero(d), leave = hn::Set(d, far);
    for (int axis = 0; axis < 3; ++axis) {
      const float* first = (ray.backwards[axis] ? node.upper : node.lower)[axis];
      const float* last = (ray.backwards[axis] ? node.lower : node.upper)[axis];
      const Vec scale = hn::Set(d, ray.reciprocal[axis]);
      enter =
          hn::Max(enter, hn::Mul(hn::Sub(hn::Load(d, first + i), hn::Set(d, ray.near_origin[axis])), scale));
      leave =
          hn::Min(leave, hn::Mul(hn::Sub(hn::Load(d, last + i), hn::Set(d, ray.far_origin[axis])), scale));
    }
    hn::Store(enter, d, near + i);
    uint8_t mask[8] = {};
    hn::StoreMaskBits(d, hn::Le(enter, hn::Mul(leave, hn::Set(d, 1.000001F))), mask);
    uint32_t word;
    std::memcpy(&word, mask, sizeof(word));
    bits |= word << i;
  }
  return bits;
}

// Appends the hits of 16 disks nearer than `far`.
HWY_INLINE void meet_disks(const BvhLeaf& leaf, const UnitRay& ray, const BlendRules<float>& rules,
                           float log_alpha_min, float near, float far, Hits& hits) {
  const Tag d;
  const hn::RebindToUnsigned<Tag> du;
  const Vec ox = hn::Set(d, ray.origin.x), oy = hn::Set(d, ray.origin.y), oz = hn::Set(d, ray.origin.z);
  const Vec dx = hn::Set(d, ray.direction.x), dy = hn::Set(d, ray.direction.y),
            dz = hn::Set(d, ray.direction.z);
  for (size_t i = 0; i < bvh_width; i += hn::Lanes(d)) {
    const auto load = [&](const float(&rows)[3][bvh_width], int axis)
                          HWY_ATTR { return hn::Load(d, rows[axis] + i); };
    const Vec qx = hn::Sub(ox, load(leaf.position, 0));
    const Vec qy = hn::Sub(oy, load(leaf.position, 1));
    const Vec qz = hn::Sub(oz, load(leaf.position, 2));
    const Vec nx = load(leaf.normal, 0), ny = load(leaf.normal, 1), nz = load(leaf.normal, 2);
    const Vec t = hn::Neg(hn::Div(dot(nx, ny, nz, qx, qy, qz), dot(nx, ny, nz, dx, dy, dz)));
    const Vec x = hn::MulAdd(t, dx, qx), y = hn::MulAdd(t, dy, qy), z = hn::MulAdd(t, dz, qz);
    const Vec u = dot(load(leaf.u, 0), load(leaf.u, 1), load(leaf.u, 2), x, y, z);
    const Vec v = dot(load(leaf.v, 0), load(leaf.v, 1), load(leaf.v, 2), x, y, z);
    const Vec radius2 = hn::MulAdd(u, u, hn::Mul(v, v));
    const Vec exponent = hn::NegMulAdd(radius2, hn::Set(d, 0.5F), hn::Load(d, leaf.log_opacity + i));
    const auto mask = hn::And(hn::Ge(exponent, hn::Set(d, log_alpha_min)),
                              hn::And(hn::Ge(t, hn::Set(d, near)), hn::Le(t, hn::Set(d, far))));
    if (hn::AllFalse(d, mask)) continue;
    const Vec alpha = hn::Min(hn::Exp(d, exponent), hn::Set(d, rules.alpha_max));
    hits.reserve_more(bvh_width);
    const size_t n = hits.count;
    hn::StoreU(hn::Compress(t, mask), d, hits.distance + n);
    hn::StoreU(hn::Compress(alpha, mask), d, hits.alpha + n);
    hn::StoreU(hn::Compress(hn::Load(du, leaf.surfel + i), hn::RebindMask(du, mask)), du, hits.surfel + n);
    hits.count = n + hn::CountTrue(d, mask);
  }
}

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

// Sorts by distance, then by surfel.
HWY_INLINE void sort_hits(Hits& hits, HitSorter& sorter) {
  if (hits.count > HitSorter::most_ranked) {
    sorter.sort_many(hits);
    return;
  }
  uint32_t rank[HitSorter::most_ranked + bvh_width];
  rank_hits(hits, rank);
  sorter.place(rank, hits);
}

class Walk {
 public:
  Walk(const Bvh& bvh, const Options& options)
      : bvh_(bvh),
        rules_{options.alpha_min, options.alpha_max, options.transmittance_min},
        log_alpha_min_(std::log(options.alpha_min)),
        near_(options.t_min),
        hits_per_look_(static_cast<size_t>(options.hits_per_pass)) {}

  // All hits up to where the ray ends for certain, in order.
  void find(const UnitRay& ray, Hits& hits, HitSorter& sorter) const {
    hits.count = 0;
    if (bvh_.nodes.empty()) return;
    const BoxRay box_ray(ray);
    float far = std::numeric_limits<float>::max();
    float transmittance = 1;
    size_t looked = 0;
    struct Entry {
      float near;
      uint32_t child;
    };
    Entry stack[bvh_stack];
    size_t depth = 0;
    stack[depth++] = {0, 0};
    while (depth > 0) {
      const Entry entry = stack[--depth];
      if (entry.near > far * 1.000001F) continue;
      if (entry.child & leaf_bit) {
        meet_disks(bvh_.leaves[entry.child & ~leaf_bit], ray, rules_, log_alpha_min_, near_, far, hits);
        if (hits.count - looked < hits_per_look_) continue;
        for (; looked < hits.count; ++looked) transmittance *= 1 - hits.alpha[looked];
        if (transmittance >= rules_.transmittance_min) continue;
        sort_hits(hits, sorter);
        cut(hits, far, transmittance);
        looked = hits.count;
        continue;
      }
      HWY_ALIGN float near[bvh_width];
      uint32_t bits = meet_boxes(bvh_.nodes[entry.child], box_ray, far, near);
      const size_t bottom = depth;
      while (bits) {
        const auto k = static_cast<size_t>(__builtin_ctz(bits));
        bits &= bits - 1;
        const Entry child{near[k], bvh_.nodes[entry.child].child[k]};
        size_t place = depth++;
        for (; place > bottom && stack[place - 1].near < child.near; --place) stack[place] = stack[place - 1];
        stack[place] = child;
      }
    }
    sort_hits(hits, sorter);
  }

 private:
  // Drops what lies behind the hit at which the ray ends. That hit stays: more hits in front can only end the
  // ray sooner.
  void cut(Hits& hits, float& far, float& transmittance) const {
    transmittance = 1;
    for (size_t i = 0; i < hits.count; ++i) {
      const bool ends = blend_ends(rules_, transmittance, hits.alpha[i]);
      transmittance *= 1 - hits.alpha[i];
      if (!ends) continue;
      hits.count = i + 1;
      far = hits.distance[i];
    }
  }

  const Bvh& bvh_;
  BlendRules<float> rules_;
  float log_alpha_min_;
  float near_;
  size_t hits_per_look_;
};

}  // namespace traceflow::trace::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
