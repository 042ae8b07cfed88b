#include "ops/raster/raster.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>

#include "base/parallel.h"
#include "ops/raster/cuda/stages.h"
#include "ops/raster/raster_kernels.h"

namespace traceflow::raster {

void Options::validate() const {
  check_option(std::isfinite(near_plane) && near_plane > 0, "near_plane", near_plane, "a length above 0");
  check_option(std::isfinite(low_pass) && low_pass >= 0, "low_pass", low_pass, "pixels, 0 or more");
  check_option(std::isfinite(far_plane) && far_plane > near_plane, "far_plane", far_plane,
               "a length above near_plane");
  check_option(alpha_min >= 1e-6F && alpha_min < 1, "alpha_min", alpha_min, "1e-6 or more, and under 1");
  check_option(alpha_max > alpha_min && alpha_max < 1, "alpha_max", alpha_max, "between alpha_min and 1");
  check_option(transmittance_min >= least_transmittance && transmittance_min < 1, "transmittance_min",
               transmittance_min, number_text(least_transmittance) + " or more, and under 1");
  for (int c = 0; c < 3; ++c) {
    check_option(std::isfinite(background[c]), "background", background[c], "finite numbers");
  }
}

void SavedDeleter::operator()(Saved* saved) const { delete saved; }
SavedPtr make_saved() { return SavedPtr(new Saved); }

namespace {

void check_input(const PosedSurfels& surfels, const Camera<float>& camera) {
  const int64_t n = surfels.count();
  require(n < (int64_t{1} << 31), "the count of surfels fits 31 bits", std::to_string(n));
  require(surfels.scale.size() == 2 * n && surfels.rotation.size() == 4 * n && surfels.opacity.size() == n,
          "surfels of one count", std::to_string(n));
  require(n == 0 || (surfels.sh.shape().rank() == 3 && surfels.sh.dim(0) == n && surfels.sh.dim(2) == 3),
          "sh is N×K×3", surfels.sh.shape().to_string());
  require(!surfels.has_tint() || surfels.tint.size() == n, "a tint for every surfel",
          surfels.tint.shape().to_string());
  require(!surfels.has_roughness() || surfels.roughness.size() == n, "a roughness for every surfel",
          surfels.roughness.shape().to_string());
  require(surfels.in_body.empty() || surfels.in_body.size() == n,
          "it is known of each surfel whether it is in a body", surfels.in_body.shape().to_string());
  require(camera.width >= 0 && camera.height >= 0 && camera.width < (1 << 20) && camera.height < (1 << 20),
          "an image size from 0 to 2^20", std::to_string(camera.width) + "×" + std::to_string(camera.height));
}

void check_gradient(const OutputGradient& g, int64_t pixels) {
  for (const auto* tensor :
       {&g.alpha, &g.tint, &g.silhouette, &g.roughness, &g.depth, &g.median_depth, &g.distortion}) {
    require(tensor->empty() || tensor->size() == pixels, "a gradient for every pixel",
            tensor->shape().to_string());
  }
  for (const auto* tensor : {&g.colour, &g.normal}) {
    require(tensor->empty() || tensor->size() == 3 * pixels, "a gradient for every pixel's vector",
            tensor->shape().to_string());
  }
}

}  // namespace

void forward(const PosedSurfels& surfels, const Camera<float>& camera, const Options& options, Output& output,
             Saved* saved) {
  options.validate();
  check_input(surfels, camera);
  Saved local;
  Saved& kept = saved != nullptr ? *saved : local;
  project_surfels(surfels, camera, options, kept);
  if (surfels.position.device() == Device::cuda) {
    cuda_stage::bin(options.sort, kept);
    cuda_stage::blend(options, output, kept);
  } else {
    bin(options.sort, kept);
    blend(options, output, kept);
  }
}

void backward(const PosedSurfels& surfels, const Camera<float>& camera, const Options& options,
              const Saved& saved, const OutputGradient& grad_output, InputGradient& gradient) {
  options.validate();
  check_input(surfels, camera);
  require(saved.count == surfels.count() && saved.width == camera.width && saved.height == camera.height,
          "backward follows forward of the same surfels and camera", std::to_string(surfels.count()));
  check_gradient(grad_output, int64_t{camera.width} * camera.height);
  if (surfels.position.device() == Device::cuda) {
    cuda_stage::blend_backward(options, saved, grad_output);
  } else {
    blend_backward(options, saved, grad_output);
  }
  project_surfels_backward(surfels, camera, saved, gradient);
}

void visible(const Saved& saved, Tensor<uint8_t>& flags) {
  const Device device = saved.splats.device();
  flags.place(device).resize({saved.count});
  if (device == Device::cuda) {
    cuda_stage::visible(saved, flags);
  } else {
    parallel_for("raster: visible", saved.count,
                 IsVisible{saved.entry_begin.data(), saved.touched.data(), flags.data()});
  }
}

Work work(const Saved& saved) {
  const Tensor<uint16_t> touched = saved.touched.on(Device::cpu);
  Work result;
  for (int64_t entry = 0; entry < saved.entries.size(); ++entry)
    result.evaluated += std::popcount(touched[entry]) * pixels_per_block;
  result.listed = saved.entries.size() * pixels_per_tile;
  return result;
}

}  // namespace traceflow::raster
