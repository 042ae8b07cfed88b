#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "ops/trace/trace_cpu_backward.cpp"
#include <hwy/foreach_target.h>
// The order matters: what is compiled once per target comes after.
#include <hwy/highway.h>

#include "base/parallel.h"
#include "math/blend.h"
#include "ops/trace/trace_backward.h"
#include "ops/trace/trace_sh-inl.h"

HWY_BEFORE_NAMESPACE();
namespace traceflow::trace::HWY_NAMESPACE {

// One ray's hits as blending saw them.
struct RayHits {
  const uint32_t* surfel;
  const float* distance;
  const float* alpha;
  size_t count;
};

// What backward works out about each hit of a ray, kept between its loops.
struct RayScratch {
  std::vector<float> transmittance;  // before the hit
  std::vector<float> own;            // dL/dweight
  std::vector<Record*> record;

  void fit(size_t count) {
    if (own.size() >= count) return;
    transmittance.resize(2 * count);
    own.resize(2 * count);
    record.resize(2 * count);
  }
};

// dL/d of one ray's outputs, distances in scene units.
struct RayGradient {
  Vec3<float> colour{0};
  float alpha = 0, distance = 0;

  RayGradient(const OutputGradient& grad, int64_t ray, float length) {
    if (!grad.colour.empty()) colour = load3<float>(grad.colour.row(ray));
    if (!grad.alpha.empty()) alpha = grad.alpha[ray];
    if (!grad.distance.empty()) distance = grad.distance[ray] / length;
  }
};

struct RaySums {
  float remaining = 1, alpha = 0, distance = 0;
};

HWY_INLINE RaySums replay(const RayHits& hits, float* HWY_RESTRICT transmittance) {
  RaySums sums;
  float distance_sum = 0;
  for (size_t i = 0; i < hits.count; ++i) {
    const float weight = hits.alpha[i] * sums.remaining;
    transmittance[i] = sums.remaining;
    sums.remaining *= 1 - hits.alpha[i];
    sums.alpha += weight;
    distance_sum += weight * hits.distance[i];
  }
  sums.distance = distance_sum / sums.alpha;
  return sums;
}

// Colours of all hits: dL/dweight and dL/dcolour of each; returns dL/d(unit direction) by SH.
template <int degree>
HWY_INLINE Vec3<float> colours_backward(const PosedSurfels& surfels, const RayHits& hits, const RaySums& sums,
                                        const RayGradient& grad, const Vec3<float>& direction,
                                        const float* HWY_RESTRICT basis, RayScratch& scratch) {
  const ShBasis<degree> spread(basis);
  float padded[16] = {grad.colour.x, grad.colour.y, grad.colour.z};
  const Rgb grad_colour = rgb_load(padded);
  ShPull<degree> pull;
  const float* sh = surfels.sh.data();
  constexpr size_t row = 3 * ShShape<degree>::coefficients;
  for (size_t i = 0; i < hits.count; ++i) {
    const float* coefficients = sh + row * hits.surfel[i];
    const Rgb raw = spread.colour(coefficients);
    const Rgb passed = rgb_gradient(raw, hits.alpha[i] * scratch.transmittance[i], grad_colour);
    pull.add(coefficients, passed);
    rgb_store(rgb_clamp(raw), padded);
    scratch.own[i] = glm::dot(load3<float>(padded), grad.colour) + grad.alpha +
                     grad.distance * (hits.distance[i] - sums.distance) / sums.alpha;
    rgb_store(passed, padded);
    std::copy_n(padded, 3, scratch.record[i]->value + part::colour);
  }
  float grad_basis[16] = {};
  pull.finish(grad_basis);
  return sh_basis_backward(degree, direction, grad_basis);
}

// One hit's geometry: fills its record and returns dL/dorigin.
HWY_INLINE Vec3<float> hit_backward(const BackwardFrame& frame, const UnitRay& ray, float distance,
                                    float grad_exponent, float grad_distance, Record& record) {
  const Vec3<float> x = ray.origin - frame.position + distance * ray.direction;
  const float along_u = dot(frame.t_u, x), along_v = dot(frame.t_v, x);
  const float u = along_u * frame.inverse_scale.x, v = along_v * frame.inverse_scale.y;
  const float grad_u = -grad_exponent * u * frame.inverse_scale.x;
  const float grad_v = -grad_exponent * v * frame.inverse_scale.y;
  const Vec3<float> grad_x = grad_u * frame.t_u + grad_v * frame.t_v;
  const float a = (grad_distance + dot(grad_x, ray.direction)) / dot(frame.normal, ray.direction);
  record.value[part::position + 0] = -grad_u;
  record.value[part::position + 1] = -grad_v;
  record.value[part::position + 2] = a;
  record.value[part::turn + 0] = a * along_v;
  record.value[part::turn + 1] = -a * along_u;
  record.value[part::turn + 2] = grad_u * along_v - grad_v * along_u;
  record.value[part::scale + 0] = -grad_u * u;
  record.value[part::scale + 1] = -grad_v * v;
  record.value[part::opacity] = grad_exponent * frame.inverse_opacity;
  record.value[part::signal] = 0.5F * distance * std::sqrt(grad_u * grad_u + grad_v * grad_v + a * a);
  return grad_x - a * frame.normal;
}

// dL/d(caller's direction) = from the unit direction, and from the distance, which is in units of its length.
HWY_INLINE Vec3<float> direction_backward(const UnitRay& ray, const Vec3<float>& grad_unit,
                                          float grad_distance, float distance) {
  const Vec3<float> tangential = grad_unit - dot(grad_unit, ray.direction) * ray.direction;
  return (tangential - grad_distance * distance * ray.direction) / ray.length;
}

template <int degree>
void backward_ray(const BackwardRays& task, int64_t position, const RayHits& hits, RayScratch& scratch) {
  const BackwardInput& input = task.input;
  const int64_t r = input.order.ray[static_cast<size_t>(position)];
  UnitRay ray;
  make_unit_ray(input.origins.row(r), input.directions.row(r), ray);
  scratch.fit(hits.count);
  for (size_t i = 0; i < hits.count; ++i) {
    scratch.record[i] = task.records + task.offsets[hits.surfel[i] / surfels_per_bucket]++;
    scratch.record[i]->ray = static_cast<uint32_t>(position - task.first_chunk_ray);
    scratch.record[i]->surfel = hits.surfel[i];
  }
  const RaySums sums = replay(hits, scratch.transmittance.data());
  const RayGradient grad(input.grad_output, r, ray.length);
  float basis[padded_basis];
  padded_sh_basis(degree, ray.direction, basis);
  std::copy_n(basis, 16, task.bases + 16 * (position - task.first_chunk_ray));
  Vec3<float> grad_unit =
      colours_backward<degree>(input.surfels, hits, sums, grad, ray.direction, basis, scratch);
  Vec3<float> grad_origin(0);
  float behind = sums.remaining * dot(grad.colour, input.options.background);
  for (size_t i = hits.count; i-- > 0;) {
    const float alpha = hits.alpha[i], transmittance = scratch.transmittance[i], own = scratch.own[i];
    const float weight = alpha * transmittance;
    const bool clamped = alpha >= input.options.alpha_max;
    const float grad_alpha = blend_alpha_gradient(transmittance, alpha, own, behind);
    behind += weight * own;
    const Vec3<float> moved =
        hit_backward(input.frames[hits.surfel[i]], ray, hits.distance[i], clamped ? 0 : grad_alpha * alpha,
                     weight * grad.distance / sums.alpha, *scratch.record[i]);
    grad_origin += moved;
    grad_unit += hits.distance[i] * moved;
  }
  store3(task.gradient.origins.row(r), grad_origin);
  store3(task.gradient.directions.row(r), direction_backward(ray, grad_unit, grad.distance, sums.distance));
}

template <int degree>
void backward_block(const BackwardRays& task) {
  thread_local RayScratch scratch;
  size_t begin = 0;
  for (size_t k = 0; k < task.saved.ray_end.size(); ++k) {
    const size_t end = task.saved.ray_end[k];
    if (end > begin) {
      backward_ray<degree>(
          task, task.first_ray + static_cast<int64_t>(k),
          {&task.saved.surfel[begin], &task.saved.distance[begin], &task.saved.alpha[begin], end - begin},
          scratch);
    }
    begin = end;
  }
}

void backward_rays(const BackwardRays& task) {
  switch (sh_degree(task.input.surfels.sh.dim(1))) {
    case 0:
      return backward_block<0>(task);
    case 1:
      return backward_block<1>(task);
    case 2:
      return backward_block<2>(task);
    default:
      return backward_block<3>(task);
  }
}

void backward_bucket(const BackwardBucket& task) {
  const hn::CappedTag<float, 16> d;
  const size_t lanes = hn::Lanes(d);
  HWY_ALIGN float sums[surfels_per_bucket][16] = {};
  HWY_ALIGN float sh[surfels_per_bucket][3][16] = {};
  for (const Record* record = task.begin; record != task.end; ++record) {
    const auto slot = static_cast<size_t>(record->surfel - task.first_surfel);
    const float* basis = task.bases + 16 * static_cast<size_t>(record->ray);
    for (size_t i = 0; i < part::count; ++i) sums[slot][i] += record->value[i];
    for (size_t i = 0; i < 16; i += lanes) {
      const auto b = hn::Load(d, basis + i);
      for (size_t c = 0; c < 3; ++c) {
        float* to = sh[slot][c] + i;
        hn::Store(hn::MulAdd(hn::Set(d, record->value[part::colour + c]), b, hn::Load(d, to)), d, to);
      }
    }
  }
  const int64_t coefficients = task.sh.dim(1);
  for (int64_t s = task.first_surfel; s < task.last_surfel; ++s) {
    const auto slot = static_cast<size_t>(s - task.first_surfel);
    for (size_t i = 0; i < part::count; ++i) task.sums[s].value[i] += sums[slot][i];
    float* row = task.sh.row(s);
    for (int64_t k = 0; k < coefficients; ++k) {
      for (int64_t c = 0; c < 3; ++c) row[3 * k + c] += sh[slot][c][k];
    }
  }
}

}  // namespace traceflow::trace::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace traceflow::trace {

HWY_EXPORT(backward_rays);
HWY_EXPORT(backward_bucket);

namespace {

// Room for one chunk.
struct ChunkRoom {
  Tensor<float> bases;
  std::vector<Record> records;
};

void chunk_backward(const BackwardInput& input, const Saved& saved, Chunk& chunk, ChunkRoom& room,
                    std::vector<Record>& sums, InputGradient& gradient) {
  const auto first_ray = static_cast<int64_t>(chunk.first_block) * rays_per_block;
  const auto blocks = static_cast<int64_t>(chunk.last_block - chunk.first_block);
  const auto buckets = static_cast<int64_t>(chunk.bucket_begin.size()) - 1;
  if (chunk.bucket_begin.back() == 0) return;
  room.bases.resize({blocks * rays_per_block, 16});
  if (room.records.size() < chunk.bucket_begin.back()) room.records.resize(chunk.bucket_begin.back());
  parallel_for(
      "trace backward rays", blocks,
      [&](int64_t b) {
        const auto k = static_cast<size_t>(b);
        HWY_DYNAMIC_DISPATCH(backward_rays)
        ({input, saved.blocks[chunk.first_block + k], first_ray + b * rays_per_block, first_ray,
          chunk.block_offsets[k], room.records.data(), room.bases.data(), gradient});
      },
      1);
  parallel_for(
      "trace backward surfels", buckets,
      [&](int64_t b) {
        const auto k = static_cast<size_t>(b);
        if (chunk.bucket_begin[k] == chunk.bucket_begin[k + 1]) return;
        const int64_t first = b * surfels_per_bucket;
        HWY_DYNAMIC_DISPATCH(backward_bucket)
        ({room.records.data() + chunk.bucket_begin[k], room.records.data() + chunk.bucket_begin[k + 1],
          room.bases.data(), first, std::min(first + surfels_per_bucket, input.surfels.count()), sums.data(),
          gradient.surfels.sh});
      },
      1);
}

}  // namespace

void backward(const PosedSurfels& surfels, const Tensor<float>& origins, const Tensor<float>& directions,
              const Options& options, const Saved& saved, const OutputGradient& grad_output,
              InputGradient& gradient) {
  const int64_t rays = origins.empty() ? 0 : origins.dim(0);
  require(static_cast<int64_t>(saved.order.ray.size()) == rays, "the hits were saved for these rays");
  gradient.surfels.reset_like(surfels);
  gradient.origins.reset({rays, 3});
  gradient.directions.reset({rays, 3});
  gradient.position_gradient.reset({surfels.count()});
  const std::vector<BackwardFrame> frames = make_backward_frames(surfels);
  std::vector<Record> sums(frames.size(), Record{});
  const BackwardInput input{surfels, origins, directions, options, grad_output, frames, saved.order};
  Chunk chunk;
  ChunkRoom room;
  for (size_t block = 0; block < saved.blocks.size(); block = chunk.last_block) {
    plan_chunk(saved, surfels.count(), block, chunk);
    chunk_backward(input, saved, chunk, room, sums, gradient);
  }
  finish_surfels(surfels, frames, sums, gradient);
}

}  // namespace traceflow::trace
#endif
