#pragma once

#include "math/blend.h"
#include "ops/trace/cuda/forward.h"
#include "ops/trace/trace_bvh.h"

// Finds the next hits of one ray, in one thread. Included by .cu files only.
namespace traceflow::trace::cuda {

inline constexpr int traversal_threads = 128;
// k: the capacity of the k-buffer. If there are more hits, the ray traverses again from the last one on.
inline constexpr int held_hits = 16;
// The tree is at most as deep as its keys have bits: 64, plus 30 of the index for equal keys. Each node on
// the path leaves at most one child on the stack.
inline constexpr int traversal_stack = 96;

// A position in a ray's order of hits.
struct HitPlace {
  float distance;
  uint32_t surfel;
  __device__ bool before(float d, uint32_t s) const { return distance < d || (distance == d && surfel < s); }
};

// The hits of a block, one column per thread.
struct HitColumns {
  float distance[held_hits][traversal_threads];
  uint32_t surfel[held_hits][traversal_threads];
  float alpha[held_hits][traversal_threads];
};

// The nearest hits of this thread's ray behind `after`, in order: at most held_hits, and fewer if the ray
// ends among them.
class KBuffer {
 public:
  __device__ KBuffer(HitColumns& columns, const BlendRules<float>& rules, float transmittance, HitPlace after)
      : columns_(columns),
        rules_(rules),
        transmittance_(transmittance),
        remaining_(transmittance),
        after_(after) {}

  __device__ int count() const { return count_; }
  __device__ float& distance(int i) { return columns_.distance[i][threadIdx.x]; }
  __device__ uint32_t& surfel(int i) { return columns_.surfel[i][threadIdx.x]; }
  __device__ float& alpha(int i) { return columns_.alpha[i][threadIdx.x]; }
  // Hits beyond this distance cannot matter.
  __device__ float far() const { return far_; }

  __device__ bool takes(float d, uint32_t s) {
    if (!after_.before(d, s) || !(d <= far_)) return false;
    return !closed_ || d < far_ || s < surfel(count_ - 1);
  }
  __device__ void insert(float d, uint32_t s, float a) {
    if (count_ == held_hits) {
      remaining_ /= 1 - alpha(count_ - 1);
    } else {
      ++count_;
    }
    int place = count_ - 1;
    for (; place > 0 && !HitPlace{distance(place - 1), surfel(place - 1)}.before(d, s); --place) {
      distance(place) = distance(place - 1);
      surfel(place) = surfel(place - 1);
      alpha(place) = alpha(place - 1);
    }
    distance(place) = d;
    surfel(place) = s;
    alpha(place) = a;
    remaining_ *= 1 - a;
    if (remaining_ < rules_.transmittance_min) cut();
    closed_ = closed_ || count_ == held_hits;
    if (closed_) far_ = distance(count_ - 1);
  }

 private:
  // Drops the hits behind the one at which the ray ends. That hit stays, because more hits in front can only
  // end the ray sooner.
  __device__ void cut() {
    remaining_ = transmittance_;
    for (int i = 0; i < count_; ++i) {
      const bool ends = blend_ends(rules_, remaining_, alpha(i));
      remaining_ *= 1 - alpha(i);
      if (!ends) continue;
      count_ = i + 1;
      closed_ = true;
      return;
    }
  }

  HitColumns& columns_;
  const BlendRules<float>& rules_;
  float transmittance_, remaining_;  // in front of the first hit, and approximately behind all of them
  HitPlace after_;
  int count_ = 0;
  float far_ = farthest_distance;
  bool closed_ = false;  // hits behind the last one do not matter
};

// A ray prepared for tests against boxes. Boxes are enlarged by the rounding error of a hit with a far
// origin. The ray crosses a plane at t = plane · reciprocal - offset. A cone enters a box when its faster
// side does, and leaves it when its slower side does, or never if that side moves the other way.
struct BoxRay {
  float near_reciprocal[3], far_reciprocal[3], near_offset[3], far_offset[3];
  bool forwards[3], open[3];

  // slope: of the cone's side, beyond which no hit counts.
  __device__ BoxRay(const UnitRay& ray, float slope) {
    const Vec3<float> o = glm::abs(ray.origin);
    const float radius = 2e-6F * std::fmax(o.x, std::fmax(o.y, o.z));
#pragma unroll
    for (int axis = 0; axis < 3; ++axis) {
      const float d = ray.direction[axis];
      const float sign = std::copysign(1.0F, d);
      forwards[axis] = sign > 0;
      open[axis] = slope > 0 && std::abs(d) <= slope;
      near_reciprocal[axis] = sign / std::fmax(std::abs(d) + slope, 1e-10F);
      far_reciprocal[axis] = sign / std::fmax(std::abs(d) - slope, 1e-10F);
      near_offset[axis] = (ray.origin[axis] + sign * radius) * near_reciprocal[axis];
      far_offset[axis] = (ray.origin[axis] - sign * radius) * far_reciprocal[axis];
    }
  }
  // The distance at which the ray enters the box of a child, at least `near`. Infinite if the ray leaves the
  // box before that, or enters it beyond `far`.
  template <int side>
  __device__ float enter(const Node& node, float near, float far) const {
    float leave = far;
#pragma unroll
    for (int axis = 0; axis < 3; ++axis) {
      const float lower = node.box[axis][2 * side], upper = node.box[axis][2 * side + 1];
      const float first = forwards[axis] ? lower : upper, last = forwards[axis] ? upper : lower;
      near = std::fmax(near, std::fma(first, near_reciprocal[axis], -near_offset[axis]));
      if (!open[axis]) leave = std::fmin(leave, std::fma(last, far_reciprocal[axis], -far_offset[axis]));
    }
    return near <= leave * 1.000001F ? near : INFINITY;
  }
};

// Adds in the same order as the CPU's vectors, so that hits at equal distances are the same on both.
__device__ inline float dot_fused(const Vec3<float>& a, const Vec3<float>& b) {
  return std::fma(a.z, b.z, std::fma(a.y, b.y, a.x * b.x));
}

__device__ inline void intersect_disk(const Disk& disk, const UnitRay& ray, const TraversalRules& rules,
                                      KBuffer& hits) {
  const DiskPlane plane = load_quads(disk.plane);
  const Vec3<float> q = ray.origin - plane.position;
  // Adding 0 turns -0 into 0, which is a valid distance.
  const float t = -(dot_fused(plane.normal, q) / dot_fused(plane.normal, ray.direction)) + 0.0F;
  if (!(t >= rules.t_min) || !hits.takes(t, plane.surfel)) return;
  const DiskAxes axes = load_quads(disk.axes);
  const Vec3<float> x(std::fma(t, ray.direction.x, q.x), std::fma(t, ray.direction.y, q.y),
                      std::fma(t, ray.direction.z, q.z));
  const float u = dot_fused(axes.u, x), v = dot_fused(axes.v, x);
  float radius2 = std::fma(u, u, v * v), top = plane.log_opacity;
  if (ray.width > 0) {
    // The growth factors of the disk's variances.
    const float spread = t * ray.width;
    const float grown_u = std::fma(spread * spread, dot_fused(axes.u, axes.u), 1.0F);
    const float grown_v = std::fma(spread * spread, dot_fused(axes.v, axes.v), 1.0F);
    radius2 = u * u / grown_u + v * v / grown_v;
    top = std::fma(-0.5F, std::log(grown_u * grown_v), top);
  }
  const float exponent = std::fma(-radius2, 0.5F, top);
  if (!(exponent >= rules.log_alpha_min)) return;
  hits.insert(t, plane.surfel, std::fmin(std::exp(exponent), rules.blend.alpha_max));
}

// Pending boxes, the nearest on top.
class TraversalStack {
 public:
  __device__ void push(float near, uint32_t child) { waiting_[depth_++] = {near, child}; }
  // Returns the next child that the ray enters before `far`, or no_child.
  __device__ uint32_t pop(float far) {
    while (depth_ > 0) {
      const Entry entry = waiting_[--depth_];
      if (entry.near <= far * 1.000001F) return entry.child;
    }
    return no_child;
  }

 private:
  struct alignas(8) Entry {
    float near;  // distance at which the ray enters the box
    uint32_t child;
  };
  Entry waiting_[traversal_stack];
  int depth_ = 0;
};

// Tests all disks of the tree that can add a hit to `hits`, near boxes first. No such hit is before `near`.
__device__ inline void traverse(const RayInput& input, const UnitRay& ray, float near, KBuffer& hits) {
  const BoxRay box_ray(ray, input.rules.deviations * ray.width);
  TraversalStack stack;
  for (uint32_t at = 0; at != no_child; at = stack.pop(hits.far())) {
    // Descends to a disk. no_child has the disk's bit too.
    while ((at & disk_bit) == 0) {
      const Node node = load_quads(input.nodes[at]);
      const float left = box_ray.enter<0>(node, near, hits.far());
      const float right = box_ray.enter<1>(node, near, hits.far());
      const bool swapped = right < left;
      const uint32_t first = swapped ? node.child[1] : node.child[0];
      const uint32_t second = swapped ? node.child[0] : node.child[1];
      if (std::fmax(left, right) < INFINITY) stack.push(std::fmax(left, right), second);
      at = std::fmin(left, right) < INFINITY ? first : stack.pop(hits.far());
    }
    if (at == no_child) return;
    intersect_disk(input.disks[at & ~disk_bit], ray, input.rules, hits);
  }
}

}  // namespace traceflow::trace::cuda
