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

// What hits do to their surfel, geometry in the surfel's own frame: the sums of these turn into the surfel's
// gradients once, at the end.
namespace part {
inline constexpr size_t position = 0;  // along t_u, t_v, n
inline constexpr size_t turn = 3;      // by a small rotation about t_u, t_v, n
inline constexpr size_t scale = 6;
inline constexpr size_t opacity = 8;
inline constexpr size_t signal = 9;  // |dL/dposition| · distance / 2
inline constexpr size_t count = 10;
inline constexpr size_t padded = 16;
}  // namespace part

struct alignas(64) SurfelSums {
  float value[part::padded];
};

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
  const Tensor<float>& origins;
  const Tensor<float>& directions;
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
