#include "ops/raster/raster_chain.h"

#include <vector>

#include "base/parallel.h"

namespace traceflow::raster {
namespace {

constexpr int64_t surfels_per_block = 256;

using CameraShare = CameraGradient<double>;

CameraShare sum_of(const CameraShare* shares, int64_t count) {
  CameraShare total;
  for (int64_t i = 0; i < count; ++i) {
    total.camera_from_world += shares[i].camera_from_world;
    total.position += shares[i].position;
  }
  return total;
}

// Per block of surfels first, then over the blocks.
CameraShare run_on_cpu(const Chain& chain, int64_t n) {
  std::vector<CameraShare> partial(static_cast<size_t>((n + surfels_per_block - 1) / surfels_per_block));
  parallel_blocks("raster: chain", n, surfels_per_block, [&](int64_t begin, int64_t end) {
    CameraShare& sum = partial[static_cast<size_t>(begin / surfels_per_block)];
    for (int64_t i = begin; i < end; ++i) {
      const CameraShare share = chain.run(i);
      sum.camera_from_world += share.camera_from_world;
      sum.position += share.position;
    }
  });
  return sum_of(partial.data(), static_cast<int64_t>(partial.size()));
}

CameraShare run_on_device(const Chain& chain, int64_t n, bool wants_camera, const Saved& saved) {
  Tensor<CameraShare>& shares = saved.scratch.camera;
  shares.place(Device::cuda).resize({wants_camera ? n : 0});
  parallel_for(Device::cuda, "raster: chain", n, ChainStep{chain, wants_camera ? shares.data() : nullptr});
  const Tensor<CameraShare> on_host = shares.on(Device::cpu);
  return sum_of(on_host.data(), on_host.size());
}

}  // namespace

void chain(const PosedSurfels& surfels, const Camera<float>& camera, const Saved& saved,
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
  gradient.screen_gradient.place(device).resize({n});

  const Chain chain{view_of(surfels),     convert<double>(camera),
                    saved.splats.data(),  saved.entry_begin.data(),
                    saved.touched.data(), saved.scratch.gradients.data(),
                    view_of(g),           gradient.screen_gradient.data()};
  const CameraShare total =
      device == Device::cpu ? run_on_cpu(chain, n) : run_on_device(chain, n, gradient.wants_camera, saved);
  gradient.camera = {};
  if (gradient.wants_camera) {
    gradient.camera = {Mat3<float>(total.camera_from_world), Vec3<float>(total.position)};
  }
}

}  // namespace traceflow::raster
