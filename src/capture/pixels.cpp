#include "capture/pixels.h"

#include "base/parallel.h"
#include "capture/image_cache.h"
#include "capture/pixels_kernels.h"

namespace traceflow {

void widen(const ViewPixels& pixels, const std::optional<Mat3<float>>& prior_turn, ViewImages& images,
           bool with_coverage) {
  const Device device = pixels.colour.device();
  images.colour.place(device).resize(pixels.colour.shape());
  images.known = pixels.known;
  images.mask = pixels.mask;
  images.depth_prior = pixels.depth_prior;
  images.coverage.place(device).resize(with_coverage ? pixels.coverage.shape() : Shape{0});
  images.normal_prior.place(device).resize(pixels.normal_prior.shape());
  constexpr int64_t grain = 16384;
  parallel_for(device, "capture: widen colours", images.colour.size(),
               WidenColour{pixels.colour.data(), images.colour.data()}, grain);
  if (!images.coverage.empty()) {
    parallel_for(device, "capture: widen coverages", images.coverage.size(),
                 WidenColour{pixels.coverage.data(), images.coverage.data()}, grain);
  }
  const bool turns = prior_turn && !pixels.mask.empty();
  parallel_for(device, "capture: widen normals", images.normal_prior.size() / 3,
               WidenNormal{pixels.normal_prior.data(), turns ? pixels.mask.data() : nullptr,
                           prior_turn.value_or(Mat3<float>(1)), images.normal_prior.data()},
               grain);
}

void take_unknown(const Tensor<float>& rendered, ViewImages& images) {
  if (images.known.empty()) return;
  require(rendered.shape() == images.colour.shape(), "a render has its photograph's size",
          rendered.shape().to_string());
  parallel_for(images.colour.device(), "capture: take unknown", images.known.size(),
               TakeUnknown{images.known.data(), rendered.data(), images.colour.data()});
}

void leave_unknown(const ViewImages& images, Tensor<float>& grad_colour) {
  if (images.known.empty()) return;
  require(grad_colour.shape() == images.colour.shape(), "a gradient has its photograph's size",
          grad_colour.shape().to_string());
  parallel_for(grad_colour.device(), "capture: leave unknown", images.known.size(),
               LeaveUnknown{images.known.data(), grad_colour.data()});
}

std::shared_ptr<const ViewPixels> load_pixels(const Capture& capture, const View& view) {
  return capture.images->load(view.id);
}

}  // namespace traceflow
