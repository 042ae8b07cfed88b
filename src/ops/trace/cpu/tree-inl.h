// Traverses the tree with a beam of rays, near parts first. Compiled once per target.
#if defined(TRACEFLOW_TRACE_TREE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef TRACEFLOW_TRACE_TREE_INL_H
#undef TRACEFLOW_TRACE_TREE_INL_H
#else
#define TRACEFLOW_TRACE_TREE_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstring>

#include "ops/trace/trace_bvh.h"
#include "ops/trace/trace_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace traceflow::trace::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::CappedTag<float, bvh_width>;
using Vec = hn::Vec<Tag>;

// The bits of a mask, lane 0 lowest.
HWY_INLINE uint32_t mask_bits(hn::Mask<Tag> mask) {
  uint8_t bytes[8] = {};
  hn::StoreMaskBits(Tag(), mask, bytes);
  uint32_t word;
  std::memcpy(&word, bytes, sizeof(word));
  return word;
}

// 1/d, finite for any d.
HWY_INLINE float safe_reciprocal(float d) { return std::copysign(1.0F, d) / std::max(std::abs(d), 1e-10F); }

// A bundle of rays and of cones about them. On each axis, the rays at distance t are within origin_radius + t
// · direction_radius of origin + t · direction. The cones extend up to t · slope from their rays.
struct Beam {
  Vec3<float> origin{0}, direction{0};
  Vec3<float> origin_radius{0}, direction_radius{0};
  float slope = 0;

  Beam(const UnitRay* rays, size_t count) {
    Vec3<float> low_origin = rays[0].origin, high_origin = low_origin;
    Vec3<float> low_direction = rays[0].direction, high_direction = low_direction;
    for (size_t i = 1; i < count; ++i) {
      low_origin = glm::min(low_origin, rays[i].origin);
      high_origin = glm::max(high_origin, rays[i].origin);
      low_direction = glm::min(low_direction, rays[i].direction);
      high_direction = glm::max(high_direction, rays[i].direction);
    }
    origin = 0.5F * low_origin + 0.5F * high_origin;
    direction = 0.5F * (low_direction + high_direction);
    const Vec3<float> farthest = glm::max(glm::abs(low_origin), glm::abs(high_origin));
    // The margin is larger than the rounding error of a hit.
    origin_radius =
        (high_origin - origin) + Vec3<float>(2e-6F * std::max({farthest.x, farthest.y, farthest.z}));
    direction_radius = count > 1 ? high_direction - direction + Vec3<float>(1e-6F) : Vec3<float>(0);
  }
  float radius(float distance) const {
    return glm::length(origin_radius) + distance * glm::length(direction_radius);
  }
};

// A beam prepared for tests against boxes. On each axis a ray is in front of the near plane of the box until
// t = (plane - near_origin) · near_reciprocal, and behind the far plane from t = (plane - far_origin) ·
// far_reciprocal. `open` is true if the beam's directions have both signs. Then the beam does not leave
// through either plane, and both values are lower bounds of t.
struct BoxBeam {
  float near_origin[3], far_origin[3];
  float near_reciprocal[3], far_reciprocal[3];
  bool backwards[3], open[3];

  explicit BoxBeam(const Beam& beam) {
    for (int axis = 0; axis < 3; ++axis) {
      const float d = beam.direction[axis], spread = beam.direction_radius[axis] + beam.slope;
      const float sign = std::signbit(d) ? -1.0F : 1.0F;
      backwards[axis] = sign < 0;
      open[axis] = std::abs(d) <= spread;
      near_origin[axis] = beam.origin[axis] + sign * beam.origin_radius[axis];
      far_origin[axis] = beam.origin[axis] - sign * beam.origin_radius[axis];
      near_reciprocal[axis] = sign / std::max(std::abs(d) + spread, 1e-10F);
      const float slowest = std::abs(d) - spread;
      far_reciprocal[axis] =
          open[axis] ? sign / std::min(slowest, -1e-10F) : sign / std::max(slowest, 1e-10F);
    }
  }
};

// Bit k is set if some ray of the beam may meet the box of child k at a distance of at most `far`. No ray
// meets it before near[k].
HWY_INLINE uint32_t intersect_boxes(const BvhNode& node, const BoxBeam& beam, float far,
                                    float* HWY_RESTRICT near) {
  const Tag d;
  uint32_t bits = 0;
  for (size_t i = 0; i < bvh_width; i += hn::Lanes(d)) {
    Vec enter = hn::Zero(d), leave = hn::Set(d, far);
    for (int axis = 0; axis < 3; ++axis) {
      const float* first = (beam.backwards[axis] ? node.upper : node.lower)[axis];
      const float* last = (beam.backwards[axis] ? node.lower : node.upper)[axis];
      const Vec in = hn::Mul(hn::Sub(hn::Load(d, first + i), hn::Set(d, beam.near_origin[axis])),
                             hn::Set(d, beam.near_reciprocal[axis]));
      const Vec out = hn::Mul(hn::Sub(hn::Load(d, last + i), hn::Set(d, beam.far_origin[axis])),
                              hn::Set(d, beam.far_reciprocal[axis]));
      enter = hn::Max(enter, in);
      if (beam.open[axis]) {
        enter = hn::Max(enter, out);
      } else {
        leave = hn::Min(leave, out);
      }
    }
    hn::Store(enter, d, near + i);
    bits |= mask_bits(hn::Le(enter, hn::Mul(leave, hn::Set(d, 1.000001F)))) << i;
  }
  return bits;
}

// Calls on_leaf(leaf) for every leaf that the beam may meet up to `far`. on_leaf may reduce `far`.
template <class OnLeaf>
HWY_INLINE void traverse_tree(const Bvh& bvh, const BoxBeam& beam, const float& far, OnLeaf&& on_leaf) {
  struct Entry {
    float near;
    uint32_t child;
  };
  if (bvh.nodes.empty()) return;
  Entry stack[bvh_stack];
  size_t depth = 0;
  stack[depth++] = {0, 0};
  while (depth > 0) {
    const Entry entry = stack[--depth];
    if (entry.near > far * 1.000001F) continue;
    if (entry.child & leaf_bit) {
      on_leaf(bvh.leaves[entry.child & ~leaf_bit]);
      continue;
    }
    HWY_ALIGN float near[bvh_width];
    const BvhNode& node = bvh.nodes[entry.child];
    const size_t bottom = depth;
    for (uint32_t bits = intersect_boxes(node, beam, far, near); bits; bits &= bits - 1) {
      const auto k = static_cast<size_t>(__builtin_ctz(bits));
      const Entry child{near[k], node.child[k]};
      size_t place = depth++;
      for (; place > bottom && stack[place - 1].near < child.near; --place) stack[place] = stack[place - 1];
      stack[place] = child;
    }
  }
}

}  // namespace traceflow::trace::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
