#include <algorithm>
#include <bit>
#include <numeric>

#include "math/spherical_harmonics.h"
#include "ops/trace/cuda/traverse.h"
#include "ops/trace/trace_bvh.h"

// The host side of both passes. Forward stores hits as long as there is room. If it runs out, backward traces
// the rays again, in parts whose hits fit.
namespace traceflow::trace::cuda {

using namespace traceflow::cuda;

namespace {

// Whether rays are sorted before they are traced. Changes speed and the order of sums.
constexpr bool sorts_rays = true;
constexpr int64_t expected_records = 64;  // per ray, as a first estimate
constexpr int64_t most_records = no_record - 1;

// Resizes a tensor on the device and returns its memory.
template <class T>
T* allocate(Tensor<T>& tensor, const Shape& shape) {
  tensor.place(Device::cuda).resize(shape);
  return tensor.data();
}

// The same for a tensor of at most `most` numbers. A growing tensor gets a quarter more memory. If that
// exceeds `most`, the tensor is freed and allocated again.
template <class T>
T* allocate_within(int64_t most, Tensor<T>& tensor, int64_t count) {
  if (tensor.size() < count && count + count / 4 > most) tensor = {};
  return allocate(tensor, {count});
}

const float* data_or_null(const Tensor<float>& tensor) { return tensor.empty() ? nullptr : tensor.data(); }

// The number of records that the limit allows.
int64_t allowed_records(const Saved& saved) {
  // For a sort that keeps its input, and for the ends of spans.
  constexpr size_t in_order = sizeof(HitParts) + 3 * (sizeof(uint64_t) + sizeof(uint32_t)) + 8;
  const size_t bytes = sizeof(Record) + (deterministic() ? in_order : 0);
  return std::clamp<int64_t>(saved.device_bytes / static_cast<int64_t>(bytes), 1, most_records);
}

// The records of a ray: its hits, and one head for each pass.
int64_t records_of(uint32_t hits) { return hits + (int64_t{hits} + held_hits - 1) / held_hits; }

SavedHits& hits_of(const Saved& saved) {
  require(saved.on_device != nullptr, "the hits were saved on the device");
  return *saved.on_device;
}

void allocate(const Saved& saved, int64_t rays, SavedHits& hits) {
  const int64_t allowed = allowed_records(saved);
  const int64_t wanted = std::min(allowed, std::max(expected_records * rays, hits.most_wanted / 4 * 5));
  if (hits.records.size() < wanted) allocate_within(allowed, hits.records, wanted);
  allocate(hits.used, {1});
  allocate(hits.last_head, {rays});
  allocate(hits.hits, {rays});
  allocate(hits.sums, {rays});
  hits.used.zero();
  hits.rays = rays;
  hits.records_wanted = SavedHits::unknown;
  hits.overwritten = false;
}

// Everything in the gradient is set later, except dL/dsh, which hits add to, and tints, which rays do not
// use.
void allocate(const PosedSurfels& surfels, const Rays& rays, InputGradient& gradient) {
  PosedSurfels& g = gradient.surfels;
  allocate(g.position, surfels.position.shape());
  allocate(g.scale, surfels.scale.shape());
  allocate(g.rotation, surfels.rotation.shape());
  allocate(g.opacity, surfels.opacity.shape());
  allocate(g.sh, surfels.sh.shape());
  allocate(g.tint, surfels.tint.shape());
  g.sh.zero();
  g.tint.zero();
  allocate(gradient.rays.origins, {rays.count(), 3});
  allocate(gradient.rays.directions, {rays.count(), 3});
  allocate(gradient.rays.widths, rays.widths.shape());
  allocate(gradient.position_gradient, {surfels.count()});
}

// Reads how many records the forward pass wanted. The host waits for the device, because the next launch
// depends on the number.
int64_t look_at_records(SavedHits& hits) {
  if (hits.records_wanted == SavedHits::unknown) {
    hits.records_wanted = static_cast<int64_t>(hits.used.on(Device::cpu)[0]);
    hits.most_wanted = std::max(hits.most_wanted, hits.records_wanted);
  }
  return hits.records_wanted;
}

RayInput input_of(const PosedSurfels& surfels, const Tree* tree, const Rays& rays, const Options& options) {
  const bool empty = tree == nullptr || tree->surfels == 0;
  return {empty ? nullptr : tree->nodes.data(),
          empty ? nullptr : tree->disks.data(),
          surfels.sh.data(),
          RayView(rays),
          nullptr,
          0,
          rays.count(),
          TraversalRules(options),
          options.background};
}

int degree_of(const PosedSurfels& surfels) { return surfels.count() == 0 ? 0 : sh_degree(surfels.sh.dim(1)); }

RecordStore store_of(SavedHits& hits) {
  return {true,
          hits.records.data(),
          static_cast<uint64_t>(hits.records.size()),
          hits.used.data(),
          hits.last_head.data(),
          hits.hits.data(),
          hits.sums.data()};
}

// The backward pass of one set of surfels and rays.
class Backward {
 public:
  Backward(const PosedSurfels& surfels, const RayInput& rays, const OutputGradient& grad, SavedHits& hits,
           InputGradient& gradient)
      : hits_(hits), degree_(degree_of(surfels)), surfels_(static_cast<uint32_t>(surfels.count())) {
    task_.rays = rays;
    task_.last_head = hits.last_head.data();
    task_.sums = hits.sums.data();
    task_.frames = hits.frames.data();
    task_.grad_colour = data_or_null(grad.colour);
    task_.grad_alpha = data_or_null(grad.alpha);
    task_.grad_distance = data_or_null(grad.distance);
    task_.grad_origins = gradient.rays.origins.data();
    task_.grad_directions = gradient.rays.directions.data();
    task_.grad_widths = gradient.rays.widths.empty() ? nullptr : gradient.rays.widths.data();
    task_.surfel_sums = hits.surfel_sums.data();
    task_.grad_sh = gradient.surfels.sh.data();
    task_.ray_bits = static_cast<int>(std::bit_width(static_cast<uint64_t>(hits.rays)));
    task_.head_key = uint64_t{surfels_} << task_.ray_bits;
  }

  // Processes rays [first, last), whose hits are in the first `records` records.
  void run(int64_t first, int64_t last, int64_t records) {
    task_.rays.first = first;
    task_.rays.last = last;
    task_.records = hits_.records.data();
    if (deterministic()) allocate_in_order(records);
    trace_backward(degree_, task_);
    if (task_.parts) {
      sum_in_order(degree_, records, surfels_, task_.ray_bits, hits_, task_.surfel_sums, task_.grad_sh);
    }
  }

  // Processes all rays in parts with at most `allowed` records each. A part always has room for at least one
  // ray.
  void trace_again(int64_t allowed) {
    require(hits_.tree != nullptr && hits_.tree->builds == hits_.builds,
            "the BVH of the forward pass is still there");
    const Tensor<uint32_t> counts = hits_.hits.on(Device::cpu);  // waits for the device
    const uint32_t most = *std::max_element(counts.values().begin(), counts.values().end());
    const int64_t space = std::max(std::min(allowed, hits_.records_wanted), records_of(most));
    if (hits_.records.size() < space) allocate_within(space, hits_.records, space);
    hits_.overwritten = true;
    for (int64_t first = 0; first < hits_.rays;) {
      int64_t last = first, records = 0;
      do records += records_of(counts[last++]);
      while (last < hits_.rays && records + records_of(counts[last]) <= space);
      keep_again(first, last);
      run(first, last, records);
      first = last;
    }
  }

 private:
  void allocate_in_order(int64_t records) {
    task_.parts = allocate(hits_.parts, {std::max<int64_t>(1, records)});
    task_.keys = allocate(hits_.keys, {records});
    task_.places = allocate(hits_.places, {records});
    task_.basis = allocate(hits_.basis, {hits_.rays, 16});
  }
  void keep_again(int64_t first, int64_t last) {
    RayInput rays = task_.rays;
    rays.first = first;
    rays.last = last;
    hits_.used.zero();
    RecordStore store = store_of(hits_);
    store.hits = nullptr;
    store.sums = nullptr;
    trace_rays(degree_, rays, {}, store);
  }

  SavedHits& hits_;
  int degree_;
  uint32_t surfels_;
  BackwardTask task_{};
};

}  // namespace

int64_t blended_hits(const Saved& saved) {
  const Tensor<uint32_t> hits = hits_of(saved).hits.on(Device::cpu);
  return std::accumulate(hits.values().begin(), hits.values().end(), int64_t{0});
}

void forward(const PosedSurfels& surfels, const Bvh& bvh, const Rays& rays, const Options& options,
             Output& output, Saved* saved) {
  const int64_t count = rays.count();
  const RayOutput to{allocate(output.colour, {count, 3}), allocate(output.alpha, {count}),
                     allocate(output.distance, {count})};
  RayInput input = input_of(surfels, bvh.on_device.get(), rays, options);
  const bool sorts = sorts_rays && count > 0 && input.nodes != nullptr;
  RecordStore store{};
  if (saved) {
    if (!saved->on_device) saved->on_device = std::make_shared<SavedHits>();
    SavedHits& hits = *saved->on_device;
    allocate(*saved, count, hits);
    hits.tree = bvh.on_device;
    hits.builds = bvh.on_device ? bvh.on_device->builds : 0;
    hits.is_sorted = sorts;
    store = store_of(hits);
  }
  if (sorts) {
    input.order = sort_rays(input, surfels.count(), saved ? saved->on_device->sorted : bvh.on_device->rays);
  }
  trace_rays(degree_of(surfels), input, to, store);
}

void backward(const PosedSurfels& surfels, const Rays& rays, const Options& options, const Saved& saved,
              const OutputGradient& grad_output, InputGradient& gradient) {
  SavedHits& hits = hits_of(saved);
  const int64_t count = surfels.count();
  require(hits.rays == rays.count(), "the hits were saved for these rays");
  allocate(surfels, rays, gradient);
  allocate(hits.surfel_sums, {count});
  hits.surfel_sums.zero();
  parallel_for(Device::cuda, "trace: frames", count, MakeFrame{surfels, allocate(hits.frames, {count})});
  const int64_t allowed = allowed_records(saved), wanted = look_at_records(hits);
  RayInput input = input_of(surfels, hits.tree.get(), rays, options);
  if (hits.is_sorted) input.order = hits.sorted.order.data();
  Backward pass(surfels, input, grad_output, hits, gradient);
  if (!hits.overwritten && wanted <= std::min(hits.records.size(), allowed)) {
    pass.run(0, rays.count(), wanted);
  } else {
    pass.trace_again(allowed);
  }
  parallel_for(Device::cuda, "trace: surfel gradients", count,
               FinishSurfel{surfels, hits.frames.data(), hits.surfel_sums.data(), gradient});
}

}  // namespace traceflow::trace::cuda
