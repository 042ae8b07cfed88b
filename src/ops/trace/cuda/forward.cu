#include "ops/trace/cuda/sh.h"
#include "ops/trace/cuda/traverse.h"

namespace traceflow::trace::cuda {

using namespace traceflow::cuda;

namespace {

// The state of one ray.
struct Blending {
  float remaining = 1, alpha = 0, distance = 0;
  Vec3<float> colour{0};
  int hits = 0;

  __device__ float mean_distance() const { return hits > 0 ? distance / alpha : 0; }
};

// Blends the hits front to back. Returns how many it blended: a ray ends in front of the hit that would leave
// too little transmittance.
template <int degree>
__device__ int blend_hits(const RayInput& input, bool coloured, KBuffer& hits, const float* basis,
                          Blending& ray) {
  constexpr int numbers = 3 * sh_coefficients(degree);
  int i = 0;
  for (; i < hits.count() && !blend_ends(input.rules.blend, ray.remaining, hits.alpha(i)); ++i) {
    const float weight = hits.alpha(i) * ray.remaining;
    ray.remaining *= 1 - hits.alpha(i);
    ray.alpha += weight;
    ray.distance += weight * hits.distance(i);
    if (!coloured) continue;
    const Vec3<float> raw = raw_colour<degree>(input.sh + int64_t{numbers} * hits.surfel(i), basis);
    ray.colour += weight * glm::max(raw, Vec3<float>(0));
  }
  ray.hits += i;
  return i;
}

// Allocates the records that each lane of the warp wants, with one atomic addition for all. All lanes take
// part.
__device__ unsigned long long take_records(unsigned long long* used, unsigned wanted) {
  const int lane = static_cast<int>(threadIdx.x) % warp_lanes;
  unsigned sum = wanted;
  for (int by = 1; by < warp_lanes; by *= 2) {
    const unsigned before = __shfl_up_sync(full_warp, sum, static_cast<unsigned>(by));
    if (lane >= by) sum += before;
  }
  unsigned long long first = 0;
  if (lane == warp_lanes - 1 && sum > 0) first = atomicAdd(used, static_cast<unsigned long long>(sum));
  first = __shfl_sync(full_warp, first, warp_lanes - 1);
  return first + sum - wanted;
}

// Stores the first `count` hits of a pass. transmittance: in front of the first of them. All lanes of the
// warp take part.
__device__ void keep_hits(const RecordStore& store, KBuffer& hits, int count, float transmittance,
                          uint32_t& last_head) {
  const unsigned wanted = count > 0 ? static_cast<unsigned>(count) + 1 : 0;
  const unsigned long long place = take_records(store.used, wanted);
  if (wanted == 0 || place + wanted > store.capacity) return;
  Record* record = store.records + place;
  store_quads(Record{last_head, __uint_as_float(static_cast<uint32_t>(count)), 0, 0}, *record);
  for (int i = 0; i < count; ++i) {
    store_quads(Record{hits.surfel(i), hits.distance(i), hits.alpha(i), transmittance}, *++record);
    transmittance *= 1 - hits.alpha(i);
  }
  last_head = static_cast<uint32_t>(place);
}

__device__ void write_ray(const RayOutput& output, const Vec3<float>& background, int64_t r,
                          const UnitRay& ray, const Blending& b) {
  store3(output.colour + 3 * r, b.colour + b.remaining * background);
  output.alpha[r] = b.alpha;
  output.distance[r] = b.hits > 0 ? b.mean_distance() / ray.length : 0;
}

__device__ void keep_ray(const RecordStore& store, int64_t i, const Blending& b) {
  store.hits[i] = static_cast<uint32_t>(b.hits);
  store.sums[i] = {b.remaining, b.alpha, b.mean_distance()};
}

// One thread per ray. In each pass all lanes of a warp find their next hits, then blend them.
template <int degree>
__global__ void __launch_bounds__(traversal_threads)
    trace_kernel(RayInput input, RayOutput output, RecordStore store) {
  __shared__ HitColumns columns;
  const int64_t i = input.own();
  const bool exists = i < input.last;
  const int64_t r = exists ? input.callers(i) : 0;
  UnitRay ray;
  bool goes_on = exists && make_unit_ray(input.rays, r, ray);
  goes_on = goes_on && input.nodes != nullptr;
  float basis[16];
  sh_basis(degree, ray.direction, basis);
  Blending blending;
  HitPlace after{-1, 0};
  uint32_t last_head = no_record;
  while (__any_sync(full_warp, goes_on)) {
    const float transmittance = blending.remaining;
    KBuffer hits(columns, input.rules.blend, transmittance, after);
    int blended = 0;
    if (goes_on) {
      traverse(input, ray, 0.999999F * std::fmax(after.distance, input.rules.t_min), hits);
      blended = blend_hits<degree>(input, output.colour != nullptr, hits, basis, blending);
      goes_on = blended == held_hits;
      if (goes_on) after = {hits.distance(held_hits - 1), hits.surfel(held_hits - 1)};
    }
    if (store.keep) keep_hits(store, hits, blended, transmittance, last_head);
  }
  if (exists && output.colour) write_ray(output, input.background, r, ray, blending);
  if (!exists || !store.keep) return;
  store.last_head[i] = last_head;
  if (store.hits) keep_ray(store, i, blending);
}

}  // namespace

void trace_rays(int degree, const RayInput& rays, const RayOutput& output, const RecordStore& store) {
  void (*const kernels[])(RayInput, RayOutput, RecordStore) = {trace_kernel<0>, trace_kernel<1>,
                                                               trace_kernel<2>, trace_kernel<3>};
  launch("trace: rays", {blocks_for(rays.last - rays.first, traversal_threads), traversal_threads},
         kernels[degree], rays, output, store);
}

}  // namespace traceflow::trace::cuda
