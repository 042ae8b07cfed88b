#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "ops/trace/trace_kernels.h"

// The backward pass takes blocks of rays in groups. Each hit of a group adds what it does to its surfel to
// the group's own sums, few enough to stay in the cache; then a surfel's sums are added up in the order of
// the groups.
namespace traceflow::trace {

inline constexpr size_t blocks_per_group = 4;
inline constexpr size_t floats_per_chunk = 1 << 24;  // of sums that are held at a time

// A surfel as the backward pass needs it.
struct alignas(64) BackwardFrame {
  Vec3<float> position, t_u, t_v, normal;
  Vec2<float> inverse_scale;
  float inverse_opacity;
  float unused;
};

// Surfel i of a set.
struct MakeFrame {
  SurfelView<float> surfels;
  BackwardFrame* frames;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const SurfelFrame<float> f = surfels.frame(i);
    frames[i] = {f.position,
                 f.rotation[0],
                 f.rotation[1],
                 f.rotation[2],
                 {1 / f.scale.x, 1 / f.scale.y},
                 1 / surfels.opacity[i],
                 0};
  }
};

// What hits do to their surfel, geometry in the surfel's own frame: the sums of these turn into the surfel's
// gradients once, at the end.
namespace part {
inline constexpr size_t position = 0;  // along t_u, t_v, n
inline constexpr size_t turn = 3;      // by a small rotation about t_u, t_v, n
inline constexpr size_t scale = 6;
inline constexpr size_t opacity = 8;
inline constexpr size_t signal = 9;  // dL/dposition · distance / 2, along t_u, t_v, n
inline constexpr size_t count = 12;
inline constexpr size_t padded = 16;
}  // namespace part

struct alignas(64) SurfelSums {
  float value[part::padded];
};

// Turns the sums of all hits of surfel i into gradients: sets all but dL/dsh, which is a sum itself.
struct FinishSurfel {
  SurfelView<float> surfels;
  const BackwardFrame* frames;
  const SurfelSums* sums;
  float *position, *scale, *rotation, *opacity, *signal;

  FinishSurfel(const PosedSurfels& s, const BackwardFrame* f, const SurfelSums* sums_of, InputGradient& g)
      : surfels(s),
        frames(f),
        sums(sums_of),
        position(g.surfels.position.data()),
        scale(g.surfels.scale.data()),
        rotation(g.surfels.rotation.data()),
        opacity(g.surfels.opacity.data()),
        signal(g.position_gradient.data()) {}

  TRACEFLOW_HD void operator()(int64_t i) const {
    const BackwardFrame& f = frames[i];
    const float* sum = sums[i].value;
    const float* p = sum + part::position;
    const float* turned = sum + part::turn;
    Vec3<float> moved(0);
    Vec4<float> q(0);
    // What has no hits may have a frame that is not finite.
    if (p[0] != 0 || p[1] != 0 || p[2] != 0) {
      moved = p[0] * f.t_u + p[1] * f.t_v + p[2] * f.normal;
      // A rotation's gradient that has these turns: its other components do not matter to a unit quaternion.
      const Mat3<float> turn(turned[2] * f.t_v - turned[1] * f.normal, turned[0] * f.normal, Vec3<float>(0));
      q = rotation_from_quaternion_backward(load4<float>(surfels.rotation + 4 * i), turn);
    }
    store3(position + 3 * i, moved);
    for (int k = 0; k < 4; ++k) rotation[4 * i + k] = q[k];
    for (int k = 0; k < 2; ++k) scale[2 * i + k] = sum[part::scale + static_cast<size_t>(k)];
    opacity[i] = sum[part::opacity];
    // The frame's axes are unit and upright on each other.
    signal[i] = glm::length(load3<float>(sum + part::signal));
  }
};

// dL/d of a ray by the places of its hits; that to the direction as a change of a unit vector.
struct RayPull {
  Vec3<float> origin{0}, direction{0};
  float width = 0;
};

// dL/d(caller's direction) = from the unit direction, and from the distance, which is in units of its length.
TRACEFLOW_HD inline Vec3<float> direction_backward(const UnitRay& ray, const Vec3<float>& grad_unit,
                                                   float grad_distance, float distance) {
  const Vec3<float> tangential = grad_unit - dot(grad_unit, ray.direction) * ray.direction;
  return (tangential - grad_distance * distance * ray.direction) / ray.length;
}

// In a group a surfel's row of sums: the parts, then dL/dsh in vectors, each of whole coefficients.
inline constexpr size_t row_floats(int64_t coefficients) {
  return part::padded + 16 * static_cast<size_t>((coefficients + 3) / 4);
}

// The blocks of rays [first_block, last_block).
struct Group {
  size_t first_block = 0, last_block = 0;
  std::vector<uint32_t> surfels;  // those hit, ascending
};

std::vector<Group> make_groups(const Saved& saved, int64_t surfels);

struct BackwardInput {
  const PosedSurfels& surfels;
  const Rays& rays;
  const Options& options;
  const OutputGradient& grad_output;
  const std::vector<BackwardFrame>& frames;
  const Saved& saved;
};

// One group: sets its rows, one for each of its surfels, and its rays' gradients.
struct BackwardGroup {
  const BackwardInput& input;
  const Group& group;
  float* rows;
  InputGradient& gradient;
};

// Adds the rows of a surfel in some groups to its sums and to dL/dsh, for surfels [begin, end).
struct BackwardSums {
  std::span<const Group> groups;
  const float* rows;  // of the first group; those of the others follow
  int64_t begin, end;
  std::vector<SurfelSums>& sums;
  Tensor<float>& sh;
};

std::vector<BackwardFrame> make_backward_frames(const PosedSurfels& surfels);
// Turns the sums of all hits into gradients of the surfels.
void finish_surfels(const PosedSurfels& surfels, const std::vector<BackwardFrame>& frames,
                    const std::vector<SurfelSums>& sums, InputGradient& gradient);

}  // namespace traceflow::trace
