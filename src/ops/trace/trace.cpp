#include "ops/trace/trace.h"

#include "ops/trace/cpu/trace.h"
#include "ops/trace/cuda/trace.h"
#include "ops/trace/trace_bvh.h"
#include "ops/trace/trace_kernels.h"

namespace traceflow::trace {

void BvhDeleter::operator()(Bvh* bvh) const { delete bvh; }
BvhPtr make_bvh() { return BvhPtr(new Bvh); }

void SavedDeleter::operator()(Saved* saved) const { delete saved; }
SavedPtr make_saved() { return SavedPtr(new Saved); }

int64_t blended_hits(const Saved& saved) {
  return saved.device == Device::cpu ? cpu::blended_hits(saved) : cuda::blended_hits(saved);
}

void limit_device_bytes(Saved& saved, int64_t bytes) { saved.device_bytes = bytes; }

void build(const PosedSurfels& surfels, const Options& options, Bvh& bvh) {
  bvh.surfels = surfels.count();
  if (surfels.device() == Device::cpu) {
    cpu::build(surfels, options, bvh);
  } else {
    cuda::build(surfels, options, bvh);
  }
}

void forward(const PosedSurfels& surfels, const Bvh& bvh, const Rays& rays, const Options& options,
             Output& output, Saved* saved) {
  require(bvh.surfels == surfels.count(), "the BVH was built from these surfels");
  require(surfels.count() == 0 || surfels.device() == rays.device() || rays.count() == 0,
          "rays and surfels are on one device");
  require(rays.widths.empty() || rays.widths.size() == rays.count(), "a width for every ray");
  if (saved) saved->device = rays.device();
  if (rays.device() == Device::cpu) {
    cpu::forward(surfels, bvh, rays, options, output, saved);
  } else {
    cuda::forward(surfels, bvh, rays, options, output, saved);
  }
}

void backward(const PosedSurfels& surfels, const Rays& rays, const Options& options, const Saved& saved,
              const OutputGradient& grad_output, InputGradient& gradient) {
  require(saved.device == rays.device(), "the hits were saved for these rays");
  if (rays.device() == Device::cpu) {
    cpu::backward(surfels, rays, options, saved, grad_output, gradient);
  } else {
    cuda::backward(surfels, rays, options, saved, grad_output, gradient);
  }
}

}  // namespace traceflow::trace
