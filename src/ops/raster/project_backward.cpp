#include "ops/raster/project_backward.h"

#include <limits>
#include <vector>

#include "base/parallel.h"
#include "ops/raster/cuda/stages.h"
#include "primitives/sums.h"

namespace traceflow::raster {
namespace {

constexpr int64_t surfels_per_block = 256;

using CameraShare = CameraGradient<double>;

// Sums each block of surfels first, then the blocks.
CameraShare run_on_cpu(const ProjectBackward& op, int64_t n) {
  std::vector<CameraShare> partial(static_cast<size_t>((n + surfels_per_block - 1) / surfels_per_block));
  parallel_blocks("raster: project backward", n, surfels_per_block, [&](int64_t begin, int64_t end) {
    CameraShare& sum = partial[static_cast<size_t>(begin / surfels_per_block)];
    for (int64_t i = begin; i < end; ++i) sum += op.run(i);
  });
  CameraShare total;
  for (const CameraShare& share : partial) total += share;
  return total;
}

CameraShare run_on_device(const ProjectBackward& op, int64_t n, bool wants_camera, const Saved& saved) {
  Tensor<CameraShare>& shares = saved.scratch.camera;
  shares.place(Device::cuda).resize({wants_camera ? n + 1 : 0});  // the last element is their sum
  cuda_stage::add_tiles(saved);
  parallel_for(Device::cuda, "raster: project backward", n,
               ProjectBackwardStep{op, wants_camera ? shares.data() : nullptr});
  CameraShare total;
  if (wants_camera) {
    ordered_sum<CameraShare>(Device::cuda, "raster: camera", n, CameraShareOf{shares.data()},
                             StoreSum<CameraGradient<double>>{shares.data() + n}, 1);
    // The host waits for this copy because poses are stored on the host.
    memory::copy(Device::cpu, &total, Device::cuda, shares.data() + n, sizeof(total));
  }
  return total;
}

}  // namespace

void project_surfels_backward(const PosedSurfels& surfels, const Camera<float>& camera, const Saved& saved,
                              InputGradient& gradient) {
  const int64_t n = surfels.count();
  const Device device = surfels.position.device();
  auto& g = gradient.surfels;
  g.position.place(device).resize(surfels.position.shape());
  g.scale.place(device).resize(surfels.scale.shape());
  g.rotation.place(device).resize(surfels.rotation.shape());
  g.opacity.place(device).resize(surfels.opacity.shape());
  g.sh.place(device).resize(surfels.sh.shape());
  g.tint.place(device).resize(surfels.tint.shape());
  g.roughness.place(device).resize(surfels.roughness.shape());
  gradient.screen_gradient.place(device).resize({n});

  const uint32_t max_tiles =
      device == Device::cpu ? std::numeric_limits<uint32_t>::max() : cuda_stage::tiles_of_one_lane;
  const ProjectBackward op{view_of(surfels),
                           convert<double>(camera),
                           saved.splats.data(),
                           saved.rho_per_pixel2,
                           saved.entry_begin.data(),
                           saved.touched.data(),
                           saved.scratch.gradients.data(),
                           max_tiles,
                           view_of(g),
                           gradient.screen_gradient.data()};
  const CameraShare total =
      device == Device::cpu ? run_on_cpu(op, n) : run_on_device(op, n, gradient.wants_camera, saved);
  gradient.camera = {};
  if (gradient.wants_camera) {
    gradient.camera = {Mat3<float>(total.camera_from_world), Vec3<float>(total.position)};
  }
}

}  // namespace traceflow::raster
