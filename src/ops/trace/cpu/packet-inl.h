// Finds all hits of a packet of coherent rays, one ray per lane. Compiled once per target.
#if defined(TRACEFLOW_TRACE_PACKET_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef TRACEFLOW_TRACE_PACKET_INL_H
#undef TRACEFLOW_TRACE_PACKET_INL_H
#else
#define TRACEFLOW_TRACE_PACKET_INL_H
#endif

#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include <bit>

#include "ops/trace/cpu/disk-inl.h"
#include "ops/trace/cpu/sort-inl.h"
#include "ops/trace/cpu/tree-inl.h"

HWY_BEFORE_NAMESPACE();
namespace traceflow::trace::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

inline constexpr size_t packet_rays = hn::MaxLanes(Tag());

// The result of a traversal. A hit of a ray refers to a candidate: a surfel that some ray of the packet hits.
struct PacketHits {
  Hits rays[packet_rays];
  std::vector<uint32_t> candidates;  // surfels
};

// Tests the bounding sphere of each disk against the beam: bit k is set if a ray or a cone may pass within
// the radius of disk k.
HWY_INLINE uint32_t intersect_spheres(const BvhLeaf& leaf, const Beam& beam) {
  const Tag d;
  const Vec dx = hn::Set(d, beam.direction.x), dy = hn::Set(d, beam.direction.y),
            dz = hn::Set(d, beam.direction.z);
  const Vec inverse_length2 = hn::Set(d, 1 / glm::dot(beam.direction, beam.direction));
  const Vec start = hn::Set(d, glm::length(beam.origin_radius)),
            spread = hn::Set(d, glm::length(beam.direction_radius) + beam.slope);
  uint32_t bits = 0;
  for (size_t i = 0; i < bvh_width; i += hn::Lanes(d)) {
    const Vec qx = hn::Sub(hn::Load(d, leaf.position[0] + i), hn::Set(d, beam.origin.x));
    const Vec qy = hn::Sub(hn::Load(d, leaf.position[1] + i), hn::Set(d, beam.origin.y));
    const Vec qz = hn::Sub(hn::Load(d, leaf.position[2] + i), hn::Set(d, beam.origin.z));
    const Vec along = dot(qx, qy, qz, dx, dy, dz);
    const Vec length2 = dot(qx, qy, qz, qx, qy, qz);
    const Vec aside2 = hn::NegMulAdd(hn::Mul(along, along), inverse_length2, length2);
    const Vec within = hn::Add(hn::Load(d, leaf.radius + i), start);
    const Vec beam_radius = hn::MulAdd(spread, hn::Add(hn::Sqrt(length2), within), within);
    // The difference of squares has an error of a few units in the last place of the larger one.
    const Vec limit = hn::MulAdd(beam_radius, beam_radius, hn::Mul(length2, hn::Set(d, 2e-6F)));
    // "Not beyond" instead of "within": if a square overflows, the test of the disk itself decides.
    bits |= (~mask_bits(hn::Gt(aside2, limit)) & ((1U << hn::Lanes(d)) - 1)) << i;
  }
  return bits;
}

class PacketTraversal {
 public:
  // Lanes from `count` on repeat the last ray and find nothing.
  HWY_INLINE PacketTraversal(const Bvh& bvh, const Tensor<float>& sh, const DiskRules& rules,
                             const UnitRay* rays, size_t count, PacketHits& hits, HitSorter& sorter)
      : bvh_(bvh),
        sh_(sh.data()),
        sh_row_(static_cast<size_t>(sh.row_size())),
        rules_(rules),
        beam_(rays, count),
        count_(count),
        hits_(hits),
        sorter_(sorter) {
    for (size_t lane = 0; lane < packet_rays; ++lane) {
      const UnitRay& ray = rays[std::min(lane, count - 1)];
      for (int axis = 0; axis < 3; ++axis) {
        origin_[axis][lane] = ray.origin[axis];
        direction_[axis][lane] = ray.direction[axis];
        reciprocal_[axis][lane] = safe_reciprocal(ray.direction[axis]);
      }
      width_[lane] = ray.width;
      slope_[lane] = rules.deviations * ray.width;
      for (int axis = 0; axis < 3; ++axis) {
        const float speed = std::abs(ray.direction[axis]);
        near_reciprocal_[axis][lane] = 1 / std::max(speed + slope_[lane], 1e-10F);
        far_reciprocal_[axis][lane] = 1 / std::max(speed - slope_[lane], 1e-10F);
      }
      far_[lane] = lane < count ? farthest_distance : -1.0F;
      transmittance_[lane] = 1;
      hits.rays[lane].count = 0;
      cut_at_[lane] = 0;
    }
    hits.candidates.clear();
    beam_.slope = *std::max_element(slope_, slope_ + packet_rays);
  }

  // Finds all hits of each ray up to where it certainly ends, in order.
  HWY_INLINE void run() {
    farthest_ = farthest_distance;
    const BoxBeam boxes(beam_);
    traverse_tree(bvh_, boxes, farthest_, [this](const BvhLeaf& leaf) HWY_ATTR { intersect_leaf(leaf); });
    for (size_t lane = 0; lane < count_; ++lane) sort(hits_.rays[lane]);
  }

 private:
  // Tests a vector of rays against each disk or a vector of disks against each ray, whichever needs fewer
  // tests.
  HWY_INLINE void intersect_leaf(const BvhLeaf& leaf) {
    const uint32_t rays = intersect_rays(leaf);
    if (rays == 0) return;
    const uint32_t disks = intersect_spheres(leaf, beam_);
    if (static_cast<size_t>(std::popcount(disks)) * packet_rays <=
        static_cast<size_t>(std::popcount(rays)) * bvh_width) {
      intersect_each_disk(leaf, disks);
    } else {
      intersect_each_ray(leaf, rays);
    }
    if (hits_.candidates.size() - looked_ >= rules_.hits_per_look) look();
  }

  // Bit l is set if ray l, or possibly its cone, meets the leaf's box before the ray ends.
  HWY_INLINE uint32_t intersect_rays(const BvhLeaf& leaf) const {
    return rules_.has_cones ? intersect_cones(leaf) : intersect_lines(leaf);
  }
  HWY_INLINE uint32_t intersect_lines(const BvhLeaf& leaf) const {
    const Tag d;
    Vec enter = hn::Zero(d), leave = hn::Load(d, far_);
    for (int axis = 0; axis < 3; ++axis) {
      const Vec origin = hn::Load(d, origin_[axis]), scale = hn::Load(d, reciprocal_[axis]);
      const Vec low = hn::Mul(hn::Sub(hn::Set(d, leaf.lower[axis]), origin), scale);
      const Vec high = hn::Mul(hn::Sub(hn::Set(d, leaf.upper[axis]), origin), scale);
      enter = hn::Max(enter, hn::Min(low, high));
      leave = hn::Min(leave, hn::Max(low, high));
    }
    return mask_bits(hn::Le(enter, hn::Mul(leave, hn::Set(d, 1.000001F))));
  }

  // On each axis a cone enters the box when its faster side does. It leaves the box when its slower side
  // does, or never if that side moves the other way.
  HWY_INLINE uint32_t intersect_cones(const BvhLeaf& leaf) const {
    const Tag d;
    const Vec slope = hn::Load(d, slope_);
    Vec enter = hn::Zero(d), leave = hn::Load(d, far_);
    for (int axis = 0; axis < 3; ++axis) {
      const Vec origin = hn::Load(d, origin_[axis]), direction = hn::Load(d, direction_[axis]);
      const Vec low = hn::Sub(hn::Set(d, leaf.lower[axis]), origin);
      const Vec high = hn::Sub(hn::Set(d, leaf.upper[axis]), origin);
      const auto backwards = hn::Lt(direction, hn::Zero(d));
      const Vec first = hn::IfThenElse(backwards, hn::Neg(high), low);
      const Vec last = hn::IfThenElse(backwards, hn::Neg(low), high);
      const auto open = hn::Le(hn::Abs(direction), slope);
      enter = hn::Max(enter, hn::Mul(first, hn::Load(d, near_reciprocal_[axis])));
      const Vec out = hn::Mul(last, hn::Load(d, far_reciprocal_[axis]));
      leave = hn::IfThenElse(open, leave, hn::Min(leave, out));
    }
    return mask_bits(hn::Le(enter, hn::Mul(leave, hn::Set(d, 1.000001F))));
  }

  HWY_INLINE void intersect_each_disk(const BvhLeaf& leaf, uint32_t disks) {
    const Tag d;
    const RayVec rays{hn::Load(d, origin_[0]),    hn::Load(d, origin_[1]),    hn::Load(d, origin_[2]),
                      hn::Load(d, direction_[0]), hn::Load(d, direction_[1]), hn::Load(d, direction_[2]),
                      hn::Load(d, width_)};
    for (; disks; disks &= disks - 1) {
      const auto k = static_cast<size_t>(__builtin_ctz(disks));
      const DiskHit hit = intersect_disk(
          rays, rules_, hn::Load(d, far_), [k, d](const float* row) HWY_ATTR { return hn::Set(d, row[k]); },
          leaf);
      if (!hn::AllFalse(d, hit.mask)) append(hit, leaf.surfel[k]);
    }
  }

  // Until all hits are found, they refer to slots of the leaf. So the order of candidates does not depend on
  // where rays end.
  HWY_INLINE void intersect_each_ray(const BvhLeaf& leaf, uint32_t rays) {
    const Tag d;
    size_t first[packet_rays];
    uint32_t found = 0;
    for (uint32_t left = rays; left; left &= left - 1) {
      const auto lane = static_cast<size_t>(__builtin_ctz(left));
      first[lane] = hits_.rays[lane].count;
      const RayVec ray{hn::Set(d, origin_[0][lane]),    hn::Set(d, origin_[1][lane]),
                       hn::Set(d, origin_[2][lane]),    hn::Set(d, direction_[0][lane]),
                       hn::Set(d, direction_[1][lane]), hn::Set(d, direction_[2][lane]),
                       hn::Set(d, width_[lane])};
      for (size_t i = 0; i < bvh_width; i += hn::Lanes(d)) {
        const DiskHit hit = intersect_disk(
            ray, rules_, hn::Set(d, far_[lane]),
            [i, d](const float* row) HWY_ATTR { return hn::Load(d, row + i); }, leaf);
        const uint32_t disks = mask_bits(hit.mask);
        if (disks) append_to(lane, hit, static_cast<uint32_t>(i));
        found |= disks << i;
      }
    }
    uint32_t candidate_of[bvh_width];
    for (; found; found &= found - 1) {
      const auto k = static_cast<size_t>(__builtin_ctz(found));
      candidate_of[k] = add_candidate(leaf.surfel[k]);
    }
    for (; rays; rays &= rays - 1) {
      const auto lane = static_cast<size_t>(__builtin_ctz(rays));
      Hits& hits = hits_.rays[lane];
      for (size_t i = first[lane]; i < hits.count; ++i) hits.surfel[i] = candidate_of[hits.surfel[i]];
    }
  }

  // Appends one ray's hits with a vector of disks, from slot `first` of the leaf on.
  HWY_INLINE void append_to(size_t lane, const DiskHit& hit, uint32_t first) {
    const Tag d;
    const hn::RebindToUnsigned<Tag> du;
    const Vec alpha = disk_alpha(hit, rules_);
    Hits& hits = hits_.rays[lane];
    hits.reserve_more(bvh_width);
    const size_t n = hits.count;
    hn::StoreU(hn::Compress(hit.distance, hit.mask), d, hits.distance + n);
    hn::StoreU(hn::Compress(alpha, hit.mask), d, hits.alpha + n);
    hn::StoreU(hn::Compress(hn::Iota(du, first), hn::RebindMask(du, hit.mask)), du, hits.surfel + n);
    hits.count = n + hn::CountTrue(d, hit.mask);
    for (size_t i = n; i < hits.count; ++i) transmittance_[lane] *= 1 - hits.alpha[i];
  }

  HWY_INLINE uint32_t add_candidate(uint32_t surfel) {
    const auto candidate = static_cast<uint32_t>(hits_.candidates.size());
    hits_.candidates.push_back(surfel);
    fetch_ahead(surfel);
    return candidate;
  }

  // Appends a disk's hits with all rays.
  HWY_INLINE void append(const DiskHit& hit, uint32_t surfel) {
    const Tag d;
    const Vec alpha = disk_alpha(hit, rules_);
    const Vec before = hn::Load(d, transmittance_);
    hn::Store(hn::IfThenElse(hit.mask, hn::Mul(before, hn::Sub(hn::Set(d, 1.0F), alpha)), before), d,
              transmittance_);
    HWY_ALIGN float distances[packet_rays];
    HWY_ALIGN float alphas[packet_rays];
    hn::Store(hit.distance, d, distances);
    hn::Store(alpha, d, alphas);
    const uint32_t candidate = add_candidate(surfel);
    for (uint32_t lanes = mask_bits(hit.mask); lanes; lanes &= lanes - 1) {
      const auto lane = static_cast<size_t>(__builtin_ctz(lanes));
      hits_.rays[lane].push(distances[lane], alphas[lane], candidate);
    }
  }

  // Prefetches the candidate's coefficients, which its colour needs after the traversal.
  HWY_INLINE void fetch_ahead(uint32_t surfel) const {
    constexpr size_t line = 64 / sizeof(float);
    const float* row = sh_ + sh_row_ * surfel;
    for (size_t i = 0; i < sh_row_; i += line) hwy::Prefetch(row + i);
    hwy::Prefetch(row + sh_row_ - 1);
  }

  // Shortens the rays that have ended.
  HWY_NOINLINE void look() {
    const Tag d;
    looked_ = hits_.candidates.size();
    const auto ended = hn::Lt(hn::Load(d, transmittance_), hn::Set(d, rules_.blend.transmittance_min));
    for (uint32_t lanes = mask_bits(ended); lanes; lanes &= lanes - 1) {
      const auto lane = static_cast<size_t>(__builtin_ctz(lanes));
      Hits& hits = hits_.rays[lane];
      if (hits.count == cut_at_[lane]) continue;
      sort(hits);
      far_[lane] = cut_hits(rules_.blend, hits, far_[lane], transmittance_[lane]);
      cut_at_[lane] = hits.count;
    }
    farthest_ = *std::max_element(far_, far_ + count_);
  }

  HWY_INLINE void sort(Hits& hits) { sort_hits(hits, sorter_, hits_.candidates.data()); }

  const Bvh& bvh_;
  const float* sh_;
  size_t sh_row_;
  const DiskRules& rules_;
  Beam beam_;
  const size_t count_;
  PacketHits& hits_;
  HitSorter& sorter_;
  float farthest_ = 0;
  size_t looked_ = 0;
  HWY_ALIGN float origin_[3][packet_rays];
  HWY_ALIGN float direction_[3][packet_rays];
  HWY_ALIGN float reciprocal_[3][packet_rays];
  HWY_ALIGN float near_reciprocal_[3][packet_rays];  // for the sides of the cones
  HWY_ALIGN float far_reciprocal_[3][packet_rays];
  HWY_ALIGN float width_[packet_rays];
  HWY_ALIGN float slope_[packet_rays];  // of the cone's side, beyond which no hit counts
  HWY_ALIGN float far_[packet_rays];
  HWY_ALIGN float transmittance_[packet_rays];
  size_t cut_at_[packet_rays];
};

}  // namespace traceflow::trace::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
