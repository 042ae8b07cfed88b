#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "ops/trace/cpu/backward.cpp"
#include <hwy/foreach_target.h>
// The order matters: code compiled once per target must come after this include.
#include <hwy/highway.h>

#include "base/parallel.h"
#include "math/blend.h"
#include "ops/trace/cpu/geometry-inl.h"
#include "ops/trace/cpu/sh-inl.h"
#include "ops/trace/cpu/trace.h"
#include "ops/trace/trace_backward.h"

HWY_BEFORE_NAMESPACE();
namespace traceflow::trace::HWY_NAMESPACE {

// One ray's hits, as blended.
struct RayHits {
  const uint32_t* surfel;
  const float* distance;
  const float* alpha;
  size_t count;
};

// Values of backward for each hit of a ray, kept between its loops.
struct RayScratch {
  std::vector<float*> row;           // of the hit's surfel
  std::vector<float> transmittance;  // before the hit
  std::vector<float> own;            // dL/dweight
  std::vector<float> grad_exponent, grad_distance;
  std::vector<float> distance;

  // With room for one vector past the end.
  void fit(size_t count) {
    if (own.size() >= count + hit_lanes) return;
    const size_t size = 2 * count + hit_lanes;
    for (auto* v : {&transmittance, &own, &grad_exponent, &grad_distance, &distance}) v->resize(size);
    row.resize(size);
  }
};

// dL/d(outputs of one ray), with distances in scene units.
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

HWY_INLINE RaySums replay(const RayHits& hits, RayScratch& scratch) {
  RaySums sums;
  float distance_sum = 0;
  for (size_t i = 0; i < hits.count; ++i) {
    const float weight = hits.alpha[i] * sums.remaining;
    scratch.transmittance[i] = sums.remaining;
    scratch.distance[i] = hits.distance[i];
    sums.remaining *= 1 - hits.alpha[i];
    sums.alpha += weight;
    distance_sum += weight * hits.distance[i];
  }
  sums.distance = distance_sum / sums.alpha;
  return sums;
}

// Differentiates the colours of all hits: sets dL/dweight of each and adds dL/dsh to the rows. Returns
// dL/d(unit direction) through SH.
template <int degree>
HWY_INLINE Vec3<float> colours_backward(const PosedSurfels& surfels, const RayHits& hits, const RaySums& sums,
                                        const RayGradient& grad, const Vec3<float>& direction,
                                        const float* HWY_RESTRICT basis, RayScratch& scratch) {
  const ShBasis<degree> spread(basis);
  float padded[16] = {grad.colour.x, grad.colour.y, grad.colour.z};
  const Rgb grad_colour = rgb_load(padded);
  ShBasisGradient<degree> basis_gradient;
  const float* sh = surfels.sh.data();
  constexpr size_t row = 3 * ShShape<degree>::coefficients;
  for (size_t i = 0; i < hits.count; ++i) {
    const float* coefficients = sh + row * hits.surfel[i];
    const Rgb raw = spread.colour(coefficients);
    const Rgb passed = rgb_gradient(raw, hits.alpha[i] * scratch.transmittance[i], grad_colour);
    basis_gradient.add(coefficients, passed);
    rgb_store(rgb_clamp(raw), padded);
    scratch.own[i] = glm::dot(load3<float>(padded), grad.colour) + grad.alpha +
                     grad.distance * (hits.distance[i] - sums.distance) / sums.alpha;
    spread.add_gradient(passed, scratch.row[i] + part::padded);
  }
  float grad_basis[16] = {};
  basis_gradient.finish(grad_basis);
  return sh_basis_backward(degree, direction, grad_basis);
}

// Differentiates blending, back to front, by the opacity and the distance of each hit.
HWY_INLINE void blend_backward(const RayHits& hits, const RaySums& sums, const RayGradient& grad,
                               const Options& options, RayScratch& scratch) {
  const float grad_distance = grad.distance / sums.alpha;
  float behind = sums.remaining * dot(grad.colour, options.background);
  for (size_t i = hits.count; i-- > 0;) {
    const float alpha = hits.alpha[i], transmittance = scratch.transmittance[i], own = scratch.own[i];
    const float weight = alpha * transmittance;
    const float grad_alpha = blend_alpha_gradient(transmittance, alpha, own, behind);
    behind += weight * own;
    scratch.grad_exponent[i] = alpha >= options.alpha_max ? 0 : grad_alpha * alpha;
    scratch.grad_distance[i] = weight * grad_distance;
  }
}

template <int degree>
void backward_ray(const BackwardInput& input, int64_t r, const RayHits& hits, RayScratch& scratch,
                  InputGradient& gradient) {
  UnitRay ray;
  make_unit_ray(RayView(input.rays), r, ray);
  const RaySums sums = replay(hits, scratch);
  const RayGradient grad(input.grad_output, r, ray.length);
  float basis[padded_basis];
  padded_sh_basis(degree, ray.direction, basis);
  const Vec3<float> by_colour =
      colours_backward<degree>(input.surfels, hits, sums, grad, ray.direction, basis, scratch);
  blend_backward(hits, sums, grad, input.options, scratch);
  const GradRay by_place =
      places_backward(input.frames.data(), ray,
                      {hits.surfel, scratch.row.data(), scratch.distance.data(), scratch.grad_exponent.data(),
                       scratch.grad_distance.data(), hits.count});
  if (!input.rays.widths.empty()) gradient.rays.widths[r] = by_place.width;
  store3(gradient.rays.origins.row(r), by_place.origin);
  store3(gradient.rays.directions.row(r),
         direction_backward(ray, by_colour + by_place.direction, grad.distance, sums.distance));
}

// Memory that a thread reuses.
struct GroupScratch {
  RayScratch ray;
  std::vector<float*> row_of;  // by surfel, for those of the group
};

template <int degree>
void backward_group_degree(const BackwardGroup& task) {
  constexpr size_t row = row_floats(sh_coefficients(degree));
  thread_local GroupScratch scratch;
  const BackwardInput& input = task.input;
  const std::vector<uint32_t>& surfels = task.group.surfels;
  scratch.row_of.resize(static_cast<size_t>(input.surfels.count()));
  std::fill_n(task.rows, row * surfels.size(), 0.0F);
  for (size_t i = 0; i < surfels.size(); ++i) scratch.row_of[surfels[i]] = task.rows + row * i;
  for (size_t b = task.group.first_block; b < task.group.last_block; ++b) {
    const SavedBlock& block = input.saved.blocks[b];
    const uint32_t* ray = &input.saved.order.ray[b * static_cast<size_t>(rays_per_block)];
    size_t begin = 0;
    for (const uint32_t end : block.ray_end) {
      const size_t count = end - begin;
      scratch.ray.fit(count);
      for (size_t i = 0; i < count; ++i) scratch.ray.row[i] = scratch.row_of[block.surfel[begin + i]];
      if (count > 0) {
        backward_ray<degree>(input, *ray,
                             {&block.surfel[begin], &block.distance[begin], &block.alpha[begin], count},
                             scratch.ray, task.gradient);
      }
      begin = end;
      ++ray;
    }
  }
}

void backward_group(const BackwardGroup& task) {
  switch (sh_degree(task.input.surfels.sh.dim(1))) {
    case 0:
      return backward_group_degree<0>(task);
    case 1:
      return backward_group_degree<1>(task);
    case 2:
      return backward_group_degree<2>(task);
    default:
      return backward_group_degree<3>(task);
  }
}

template <int degree>
void add_rows_degree(const BackwardSums& task) {
  constexpr size_t row = row_floats(sh_coefficients(degree));
  const float* rows = task.rows;
  for (const Group& group : task.groups) {
    const auto first = std::lower_bound(group.surfels.begin(), group.surfels.end(), task.begin);
    for (auto s = first; s != group.surfels.end() && *s < task.end; ++s) {
      const float* from = rows + row * static_cast<size_t>(s - group.surfels.begin());
      for (size_t i = 0; i < part::count; ++i) task.sums[*s].value[i] += from[i];
      sh_add_sums<degree>(from + part::padded, task.sh.row(*s));
    }
    rows += row * group.surfels.size();
  }
}

void add_rows(const BackwardSums& task) {
  switch (sh_degree(task.sh.dim(1))) {
    case 0:
      return add_rows_degree<0>(task);
    case 1:
      return add_rows_degree<1>(task);
    case 2:
      return add_rows_degree<2>(task);
    default:
      return add_rows_degree<3>(task);
  }
}

}  // namespace traceflow::trace::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace traceflow::trace {

HWY_EXPORT(backward_group);
HWY_EXPORT(add_rows);

namespace {

// The next groups whose sums fit in memory together; at least one.
std::span<const Group> next_chunk(const std::vector<Group>& groups, size_t first, size_t row,
                                  size_t& floats) {
  size_t last = first;
  floats = 0;
  do {
    floats += row * groups[last++].surfels.size();
  } while (last < groups.size() && floats + row * groups[last].surfels.size() <= floats_per_chunk);
  return std::span(groups).subspan(first, last - first);
}

void chunk_backward(const BackwardInput& input, std::span<const Group> groups, Tensor<float>& rows,
                    std::vector<SurfelSums>& sums, InputGradient& gradient) {
  constexpr int64_t surfels_per_task = 256;
  const size_t row = row_floats(input.surfels.sh.dim(1));
  std::vector<float*> group_rows;
  float* next = rows.data();
  for (const Group& group : groups) {
    group_rows.push_back(next);
    next += row * group.surfels.size();
  }
  parallel_for(
      "trace backward rays", static_cast<int64_t>(groups.size()),
      [&](int64_t i) {
        const auto k = static_cast<size_t>(i);
        HWY_DYNAMIC_DISPATCH(backward_group)({input, groups[k], group_rows[k], gradient});
      },
      1);
  parallel_blocks("trace backward surfels", input.surfels.count(), surfels_per_task,
                  [&](int64_t begin, int64_t end) {
                    HWY_DYNAMIC_DISPATCH(add_rows)
                    ({groups, rows.data(), begin, end, sums, gradient.surfels.sh});
                  });
}

}  // namespace

void cpu::backward(const PosedSurfels& surfels, const Rays& rays, const Options& options, const Saved& saved,
                   const OutputGradient& grad_output, InputGradient& gradient) {
  require(static_cast<int64_t>(saved.order.ray.size()) == rays.count(), "the hits were saved for these rays");
  gradient.surfels.reset_like(surfels);
  gradient.rays.origins.place(Device::cpu).reset({rays.count(), 3});
  gradient.rays.directions.place(Device::cpu).reset({rays.count(), 3});
  gradient.rays.widths.place(Device::cpu).reset(rays.widths.shape());
  gradient.position_gradient.place(Device::cpu).reset({surfels.count()});
  const std::vector<BackwardFrame> frames = make_backward_frames(surfels);
  std::vector<SurfelSums> sums(frames.size(), SurfelSums{});
  const BackwardInput input{surfels, rays, options, grad_output, frames, saved};
  const std::vector<Group> groups = make_groups(saved, surfels.count());
  Tensor<float> rows;
  for (size_t first = 0; first < groups.size();) {
    size_t floats = 0;
    const std::span<const Group> chunk = next_chunk(groups, first, row_floats(surfels.sh.dim(1)), floats);
    if (rows.size() < static_cast<int64_t>(floats)) rows.resize({static_cast<int64_t>(floats)});
    chunk_backward(input, chunk, rows, sums, gradient);
    first += chunk.size();
  }
  finish_surfels(surfels, frames, sums, gradient);
}

}  // namespace traceflow::trace
#endif
