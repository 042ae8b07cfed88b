#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "ops/trace/trace_kernels.h"

// The backward pass goes over chunks of rays. First rays: each hit of a ray writes a record of what it does
// to its surfel into the bucket of the surfel. Then surfels: each bucket adds up its records, in the order of
// the rays.
namespace traceflow::trace {

inline constexpr int64_t surfels_per_bucket = 128;
inline constexpr int64_t records_per_chunk = 1 << 19;

// A surfel as the backward pass needs it.
struct alignas(64) BackwardFrame {
  Vec3<float> position, t_u, t_v, normal;
  Vec2<float> inverse_scale;
  float inverse_opacity;
  float unused;
};

// What one hit does to its surfel, geometry in the surfel's own frame: the sums of these turn into the
// surfel's gradients once, at the end.
struct alignas(64) Record {
  float value[13];  // see part::
  uint32_t ray;     // in the chunk
  uint32_t surfel;
  uint32_t unused;
};
namespace part {
inline constexpr size_t position = 0;  // along t_u, t_v, n
inline constexpr size_t turn = 3;      // by a small rotation about t_u, t_v, n
inline constexpr size_t scale = 6;
inline constexpr size_t opacity = 8;
inline constexpr size_t colour = 9;   // dL/dcolour, zero where the colour is clamped
inline constexpr size_t signal = 12;  // |dL/dposition| · distance / 2
inline constexpr size_t count = 13;
}  // namespace part

// The blocks of rays of one chunk and where each writes.
struct Chunk {
  size_t first_block = 0, last_block = 0;
  std::vector<uint32_t> bucket_begin;                // of each bucket, and of the end
  std::vector<std::vector<uint32_t>> block_offsets;  // per block, per bucket: where its next record goes
};

// The largest chunk from `first_block` on.
void plan_chunk(const Saved& saved, int64_t surfels, size_t first_block, Chunk& chunk);

struct BackwardInput {
  const PosedSurfels& surfels;
  const Tensor<float>& origins;
  const Tensor<float>& directions;
  const Options& options;
  const OutputGradient& grad_output;
  const std::vector<BackwardFrame>& frames;
  const RayOrder& order;
};

// One block of rays: writes records, the rays' gradients, and the rays' SH bases.
struct BackwardRays {
  const BackwardInput& input;
  const SavedBlock& saved;
  int64_t first_ray;        // of the block; in the tracer's order, as all positions here
  int64_t first_chunk_ray;  // of the chunk
  std::vector<uint32_t>& offsets;
  Record* records;
  float* bases;  // padded to 16 per ray of the chunk
  InputGradient& gradient;
};

// One bucket: adds its records to the sums.
struct BackwardBucket {
  const Record* begin;
  const Record* end;
  const float* bases;
  int64_t first_surfel, last_surfel;
  Record* sums;       // per surfel
  Tensor<float>& sh;  // dL/dsh
};

std::vector<BackwardFrame> make_backward_frames(const PosedSurfels& surfels);
// Turns the sums of all records into gradients of the surfels.
void finish_surfels(const PosedSurfels& surfels, const std::vector<BackwardFrame>& frames,
                    const std::vector<Record>& sums, InputGradient& gradient);

}  // namespace traceflow::trace
