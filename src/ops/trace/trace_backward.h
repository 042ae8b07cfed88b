#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "ops/trace/trace_kernels.h"

// The backward pass processes blocks of rays in groups. Each hit adds its contribution to its surfel's sums
// of the group, which are few enough to stay in the cache. Then each surfel's sums are added over the groups,
// in order.
namespace traceflow::trace {

inline constexpr size_t blocks_per_group = 4;
inline constexpr size_t floats_per_chunk = 1 << 24;  // sums kept in memory at once

// The data of a surfel that the backward pass reads.
struct alignas(64) BackwardFrame {
  Vec3<float> position, t_u, t_v, normal;
  Vec2<float> inverse_scale;
  float inverse_opacity;
  float unused;
};

// Sets the frame of surfel i.
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

// Indices of the contributions of hits to a surfel. Geometry is in the surfel's own frame, so that the sums
// are converted to the surfel's gradients only once, at the end.
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

// Converts the sums over all hits of surfel i to gradients. Sets all but dL/dsh, which is summed directly.
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
    // A surfel without hits may have a frame that is not finite.
    if (p[0] != 0 || p[1] != 0 || p[2] != 0) {
      moved = p[0] * f.t_u + p[1] * f.t_v + p[2] * f.normal;
      // A gradient of the rotation matrix with these derivatives by small rotations. Its other components do
      // not affect a unit quaternion.
      const Mat3<float> turn(turned[2] * f.t_v - turned[1] * f.normal, turned[0] * f.normal, Vec3<float>(0));
      q = rotation_from_quaternion_backward(load4<float>(surfels.rotation + 4 * i), turn);
    }
    store3(position + 3 * i, moved);
    for (int k = 0; k < 4; ++k) rotation[4 * i + k] = q[k];
    for (int k = 0; k < 2; ++k) scale[2 * i + k] = sum[part::scale + static_cast<size_t>(k)];
    opacity[i] = sum[part::opacity];
    // The frame's axes are orthonormal, so the norm is that in world axes.
    signal[i] = glm::length(load3<float>(sum + part::signal));
  }
};

// dL/d(ray) through the geometry of its hits. `direction` is the derivative by a unit vector.
struct GradRay {
  Vec3<float> origin{0}, direction{0};
  float width = 0;
};

// dL/d(caller's direction), from the gradient by the unit direction and from that by the distance, which is
// in units of the direction's length.
TRACEFLOW_HD inline Vec3<float> direction_backward(const UnitRay& ray, const Vec3<float>& grad_unit,
                                                   float grad_distance, float distance) {
  const Vec3<float> tangential = grad_unit - dot(grad_unit, ray.direction) * ray.direction;
  return (tangential - grad_distance * distance * ray.direction) / ray.length;
}

// The length of a surfel's row of sums in a group: the contributions, then dL/dsh padded to vectors, each of
// whole coefficients.
inline constexpr size_t row_floats(int64_t coefficients) {
  return part::padded + 16 * static_cast<size_t>((coefficients + 3) / 4);
}

// The blocks of rays [first_block, last_block).
struct Group {
  size_t first_block = 0, last_block = 0;
  std::vector<uint32_t> surfels;  // surfels that were hit, ascending
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

// Processes one group: sets its rows, one per surfel, and the gradients of its rays.
struct BackwardGroup {
  const BackwardInput& input;
  const Group& group;
  float* rows;
  InputGradient& gradient;
};

// Adds the rows of surfels [begin, end) in some groups to their sums and to dL/dsh.
struct BackwardSums {
  std::span<const Group> groups;
  const float* rows;  // of the first group; rows of the others follow
  int64_t begin, end;
  std::vector<SurfelSums>& sums;
  Tensor<float>& sh;
};

std::vector<BackwardFrame> make_backward_frames(const PosedSurfels& surfels);
// Converts the sums over all hits to gradients of the surfels.
void finish_surfels(const PosedSurfels& surfels, const std::vector<BackwardFrame>& frames,
                    const std::vector<SurfelSums>& sums, InputGradient& gradient);

}  // namespace traceflow::trace
