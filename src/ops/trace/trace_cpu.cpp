#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "ops/trace/trace_cpu.cpp"
#include <hwy/foreach_target.h>
// The order matters: what is compiled once per target comes after.
#include <hwy/highway.h>

#include "base/parallel.h"
#include "ops/trace/trace_sh-inl.h"
#include "ops/trace/trace_walk-inl.h"

// A ray at a time: walk the tree for all hits, sort them, blend. Blocks of rays go to threads.
HWY_BEFORE_NAMESPACE();
namespace traceflow::trace::HWY_NAMESPACE {

// Room that a thread reuses from ray to ray.
struct Scratch {
  Hits hits;
  HitSorter sorter;
  std::vector<float> weights;
};

// Front-to-back blending of sorted hits; returns how many were blended.
HWY_INLINE size_t blend_hits(const Hits& hits, const BlendRules<float>& rules, float* HWY_RESTRICT weights,
                             float& remaining, float& alpha, float& distance) {
  float transmittance = 1, alpha_sum = 0, distance_sum = 0;
  size_t i = 0;
  for (; i < hits.count && !blend_ends(rules, transmittance, hits.alpha[i]); ++i) {
    const float weight = hits.alpha[i] * transmittance;
    weights[i] = weight;
    transmittance *= 1 - hits.alpha[i];
    alpha_sum += weight;
    distance_sum += weight * hits.distance[i];
  }
  remaining = transmittance;
  alpha = alpha_sum;
  distance = i > 0 ? distance_sum / alpha_sum : 0;
  return i;
}

template <int degree>
HWY_INLINE Vec3<float> blend_colours(const PosedSurfels& surfels, const Hits& hits, size_t count,
                                     const float* HWY_RESTRICT weights, const Vec3<float>& direction) {
  float basis[padded_basis];
  padded_sh_basis(degree, direction, basis);
  const ShBasis<degree> spread(basis);
  const float* sh = surfels.sh.data();
  constexpr size_t row = 3 * ShShape<degree>::coefficients;
  Rgb sum = rgb_black();
  for (size_t i = 0; i < count; ++i) {
    sum = rgb_add(weights[i], rgb_clamp(spread.colour(sh + row * hits.surfel[i])), sum);
  }
  float lanes[16];
  rgb_store(sum, lanes);
  return load3<float>(lanes);
}

template <int degree>
void trace_block(const BlockTask& task) {
  thread_local Scratch scratch;
  const Walk walk(task.bvh, task.options);
  const BlendRules<float> rules{task.options.alpha_min, task.options.alpha_max,
                                task.options.transmittance_min};
  for (int64_t r = task.begin; r < task.end; ++r) {
    UnitRay ray;
    float remaining = 1, alpha = 0, distance = 0;
    Vec3<float> colour(0);
    if (make_unit_ray(task.origins.row(r), task.directions.row(r), ray)) {
      Hits& hits = scratch.hits;
      walk.find(ray, hits, scratch.sorter);
      if (scratch.weights.size() < hits.count) scratch.weights.resize(2 * hits.count);
      const size_t count = blend_hits(hits, rules, scratch.weights.data(), remaining, alpha, distance);
      colour = blend_colours<degree>(task.surfels, hits, count, scratch.weights.data(), ray.direction);
      distance /= ray.length;
      if (task.saved) task.saved->append(hits, count);
    }
    if (task.saved) task.saved->end_ray();
    store3(task.output.colour.row(r), colour + remaining * task.options.background);
    task.output.alpha[r] = alpha;
    task.output.distance[r] = distance;
  }
}

void trace_rays(const BlockTask& task) {
  switch (sh_degree(task.surfels.sh.dim(1))) {
    case 0:
      return trace_block<0>(task);
    case 1:
      return trace_block<1>(task);
    case 2:
      return trace_block<2>(task);
    default:
      return trace_block<3>(task);
  }
}

}  // namespace traceflow::trace::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace traceflow::trace {

HWY_EXPORT(trace_rays);

void SavedDeleter::operator()(Saved* saved) const { delete saved; }
SavedPtr make_saved() { return SavedPtr(new Saved); }

int64_t blended_hits(const Saved& saved) {
  int64_t sum = 0;
  for (const SavedBlock& block : saved.blocks) sum += static_cast<int64_t>(block.surfel.size());
  return sum;
}

void forward(const PosedSurfels& surfels, const Bvh& bvh, const Tensor<float>& origins,
             const Tensor<float>& directions, const Options& options, Output& output, Saved* saved) {
  require(bvh.surfels == surfels.count(), "the BVH was built from these surfels");
  const int64_t rays = origins.empty() ? 0 : origins.dim(0);
  output.colour.resize({rays, 3});
  output.alpha.resize({rays});
  output.distance.resize({rays});
  if (saved) {
    saved->rays = rays;
    saved->blocks.resize(static_cast<size_t>((rays + rays_per_block - 1) / rays_per_block));
  }
  parallel_blocks("trace forward", rays, rays_per_block, [&](int64_t begin, int64_t end) {
    SavedBlock* block = saved ? &saved->blocks[static_cast<size_t>(begin / rays_per_block)] : nullptr;
    if (block) block->clear();
    HWY_DYNAMIC_DISPATCH(trace_rays)
    ({surfels, bvh, origins, directions, options, begin, end, output, block});
  });
}

}  // namespace traceflow::trace
#endif
