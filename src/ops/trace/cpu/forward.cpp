#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "ops/trace/cpu/forward.cpp"
#include <hwy/foreach_target.h>
// The order matters: code compiled once per target must come after this include.
#include <hwy/highway.h>

#include "base/parallel.h"
#include "ops/trace/cpu/packet-inl.h"
#include "ops/trace/cpu/ray-inl.h"
#include "ops/trace/cpu/sh-inl.h"
#include "ops/trace/cpu/trace.h"

// Rays are sorted so that neighbours have similar paths, and are traced in packets of one ray per lane. A
// packet traverses the tree once for all its rays. If they diverge too much, each ray traverses alone. Then
// the hits of each ray are sorted and blended.
HWY_BEFORE_NAMESPACE();
namespace traceflow::trace::HWY_NAMESPACE {

// Memory that a thread reuses.
struct Scratch {
  PacketHits packet;
  Hits ray;
  HitSorter sorter;
  std::vector<float> weights;         // of one ray's hits
  std::vector<float> packet_weights;  // by candidate, one lane per ray
};

struct Blended {
  size_t hits = 0;
  float remaining = 1, alpha = 0;
  float distance_sum = 0;
};

// Front-to-back blending of sorted hits.
HWY_INLINE Blended blend_hits(const Hits& hits, const BlendRules<float>& rules, std::vector<float>& weights) {
  if (weights.size() < hits.count) weights.resize(2 * hits.count);
  Blended b;
  for (; b.hits < hits.count && !blend_ends(rules, b.remaining, hits.alpha[b.hits]); ++b.hits) {
    const float weight = hits.alpha[b.hits] * b.remaining;
    weights[b.hits] = weight;
    b.remaining *= 1 - hits.alpha[b.hits];
    b.alpha += weight;
    b.distance_sum += weight * hits.distance[b.hits];
  }
  return b;
}

HWY_INLINE void write_ray(const BlockTask& task, int64_t r, const UnitRay& ray, const Blended& b,
                          const Vec3<float>& colour) {
  store3(task.output.colour.row(r), colour + b.remaining * task.options.background);
  task.output.alpha[r] = b.alpha;
  task.output.distance[r] = b.hits > 0 ? b.distance_sum / b.alpha / ray.length : 0;
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
void trace_ray(const BlockTask& task, const DiskRules& rules, int64_t r, const UnitRay& ray,
               Scratch& scratch) {
  find_hits(task.bvh, ray, rules, scratch.ray, scratch.sorter);
  const Blended b = blend_hits(scratch.ray, rules.blend, scratch.weights);
  write_ray(task, r, ray, b,
            blend_colours<degree>(task.surfels, scratch.ray, b.hits, scratch.weights.data(), ray.direction));
  if (!task.saved) return;
  task.saved->append(scratch.ray, b.hits, nullptr);
  task.saved->end_ray();
}

// Up to packet_rays traceable rays that are adjacent in the tracer's order.
struct Packet {
  UnitRay rays[packet_rays];
  int64_t index[packet_rays];  // the caller's index
  size_t count = 0;
};

// The colours of all rays of a packet, one per lane. The coefficients of a candidate are read once for all
// rays.
template <int degree>
HWY_INLINE void packet_colours(const PosedSurfels& surfels, const Packet& packet, const Scratch& scratch,
                               float (&colours)[3][packet_rays]) {
  constexpr size_t coefficients = sh_coefficients(degree);
  const Tag d;
  HWY_ALIGN float basis[coefficients][packet_rays] = {};
  for (size_t lane = 0; lane < packet.count; ++lane) {
    float own[16];
    sh_basis(degree, packet.rays[lane].direction, own);
    for (size_t k = 0; k < coefficients; ++k) basis[k][lane] = own[k];
  }
  Vec sum[3] = {hn::Zero(d), hn::Zero(d), hn::Zero(d)};
  const float* sh = surfels.sh.data();
  for (size_t i = 0; i < scratch.packet.candidates.size(); ++i) {
    const float* row = sh + 3 * coefficients * scratch.packet.candidates[i];
    const Vec weight = hn::LoadU(d, scratch.packet_weights.data() + i * packet_rays);
    for (size_t c = 0; c < 3; ++c) {
      Vec colour = hn::Set(d, 0.5F);
      for (size_t k = 0; k < coefficients; ++k) {
        colour = hn::MulAdd(hn::Load(d, basis[k]), hn::Set(d, row[3 * k + c]), colour);
      }
      const Vec clamped = hn::Min(hn::Max(colour, hn::Zero(d)), hn::Set(d, 1e30F));  // 0 · inf is not 0
      sum[c] = hn::MulAdd(weight, clamped, sum[c]);
    }
  }
  for (size_t c = 0; c < 3; ++c) hn::Store(sum[c], d, colours[c]);
}

template <int degree>
void trace_packet(const BlockTask& task, const DiskRules& rules, const Packet& packet, Scratch& scratch) {
  PacketTraversal(task.bvh, task.surfels.sh, rules, packet.rays, packet.count, scratch.packet, scratch.sorter)
      .run();
  const std::vector<uint32_t>& candidates = scratch.packet.candidates;
  scratch.packet_weights.assign(candidates.size() * packet_rays, 0.0F);
  Blended blended[packet_rays];
  for (size_t lane = 0; lane < packet.count; ++lane) {
    const Hits& hits = scratch.packet.rays[lane];
    blended[lane] = blend_hits(hits, rules.blend, scratch.weights);
    for (size_t i = 0; i < blended[lane].hits; ++i) {
      scratch.packet_weights[hits.surfel[i] * packet_rays + lane] = scratch.weights[i];
    }
    if (!task.saved) continue;
    task.saved->append(hits, blended[lane].hits, candidates.data());
    task.saved->end_ray();
  }
  HWY_ALIGN float colours[3][packet_rays];
  packet_colours<degree>(task.surfels, packet, scratch, colours);
  for (size_t lane = 0; lane < packet.count; ++lane) {
    write_ray(task, packet.index[lane], packet.rays[lane], blended[lane],
              {colours[0][lane], colours[1][lane], colours[2][lane]});
  }
}

// Returns whether one traversal for all rays is worth its wider beam.
HWY_INLINE bool is_coherent(const BlockTask& task, const Packet& packet) {
  constexpr float widest = 2.0F;  // in leaf sizes, at the typical distance
  return packet.count > 1 &&
         Beam(packet.rays, packet.count).radius(task.order.sample_distance) < widest * task.bvh.leaf_size;
}

template <int degree>
HWY_INLINE void trace_together_or_alone(const BlockTask& task, const DiskRules& rules, const Packet& packet,
                                        Scratch& scratch) {
  if (is_coherent(task, packet)) {
    trace_packet<degree>(task, rules, packet, scratch);
    return;
  }
  for (size_t i = 0; i < packet.count; ++i) {
    trace_ray<degree>(task, rules, packet.index[i], packet.rays[i], scratch);
  }
}

template <int degree>
void trace_block(const BlockTask& task) {
  thread_local Scratch scratch;
  const DiskRules rules(task.options, !task.rays.widths.empty());
  const RayView rays(task.rays);
  for (int64_t i = task.begin; i < task.end;) {
    Packet packet;
    for (; i < task.end && packet.count < packet_rays; ++i) {
      const int64_t r = task.order.ray[static_cast<size_t>(i)];
      UnitRay& ray = packet.rays[packet.count];
      if (make_unit_ray(rays, r, ray)) {
        packet.index[packet.count++] = r;
      } else {
        write_ray(task, r, {}, {}, Vec3<float>(0));
      }
    }
    trace_together_or_alone<degree>(task, rules, packet, scratch);
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

int64_t cpu::blended_hits(const Saved& saved) {
  int64_t sum = 0;
  for (const SavedBlock& block : saved.blocks) sum += static_cast<int64_t>(block.surfel.size());
  return sum;
}

void cpu::forward(const PosedSurfels& surfels, const Bvh& bvh, const Rays& rays, const Options& options,
                  Output& output, Saved* saved) {
  const int64_t count = rays.count();
  output.colour.place(Device::cpu).resize({count, 3});
  output.alpha.place(Device::cpu).resize({count});
  output.distance.place(Device::cpu).resize({count});
  RayOrder unsaved;
  RayOrder& order = saved ? saved->order : unsaved;
  order_rays(bvh, rays, order);
  if (saved) {
    saved->blocks.resize(static_cast<size_t>((count + rays_per_block - 1) / rays_per_block));
  }
  parallel_blocks("trace forward", count, rays_per_block, [&](int64_t begin, int64_t end) {
    SavedBlock* block = saved ? &saved->blocks[static_cast<size_t>(begin / rays_per_block)] : nullptr;
    if (block) block->clear();
    HWY_DYNAMIC_DISPATCH(trace_rays)
    ({surfels, bvh, rays, options, order, begin, end, output, block});
  });
}

}  // namespace traceflow::trace
#endif
