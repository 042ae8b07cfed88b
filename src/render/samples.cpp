#include "render/samples.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "render/samples_kernels.h"

namespace traceflow::samples {

namespace {

constexpr auto what = "render: average samples";

SamplesOf samples_of(const Tensor<float>& picture, int per_side) { return {picture.dim(1), per_side}; }

Shape shape_of_samples(const Shape& picture, int per_side) {
  const int64_t n = per_side;
  if (picture.rank() == 3) return {n * picture[0], n * picture[1], picture[2]};
  return {n * picture[0], n * picture[1]};
}

Shape shape_of_picture(const Shape& samples, int per_side) {
  if (samples.rank() == 3) return {samples[0] / per_side, samples[1] / per_side, samples[2]};
  return {samples[0] / per_side, samples[1] / per_side};
}

int64_t channels(const Tensor<float>& layer) { return layer.shape().rank() == 3 ? layer.dim(2) : 1; }
int64_t pixels(const Tensor<float>& layer) { return layer.dim(0) * layer.dim(1); }

// device: that of the samples, since an empty gradient may be on any device.
void spread_layer(Device device, const Tensor<float>& picture, int per_side, Tensor<float>& samples) {
  if (picture.empty()) {
    samples.place(device).resize({0});
    return;
  }
  samples.place(device).resize(shape_of_samples(picture.shape(), per_side));
  parallel_for(device, what, pixels(picture),
               AverageSamplesBackward{samples_of(picture, per_side), channels(picture), picture.data(),
                                      samples.data()});
}

}  // namespace

void average(const Tensor<float>& samples, int per_side, Tensor<float>& picture) {
  const Device device = samples.device();
  if (samples.empty()) {
    picture.place(device).resize({0});
    return;
  }
  picture.place(device).resize(shape_of_picture(samples.shape(), per_side));
  parallel_for(
      device, what, pixels(picture),
      AverageSamples{samples_of(picture, per_side), channels(picture), samples.data(), picture.data()});
}

void average_backward(const Tensor<float>& grad_picture, int per_side, Tensor<float>& grad_samples) {
  spread_layer(grad_picture.device(), grad_picture, per_side, grad_samples);
}

int samples_for(const Camera<float>& camera, int per_side, float focal, int most) {
  constexpr float enough = 0.1F;
  if (focal <= 0) return std::min(per_side, most);
  const float wanted = static_cast<float>(per_side) * focal / std::min(camera.focal_x, camera.focal_y);
  const float rounded = std::ceil(wanted * (1 - enough));
  return rounded < static_cast<float>(most) ? std::max(1, static_cast<int>(rounded)) : most;
}

float low_pass_for(const Camera<float>& camera, int samples, int per_side, float focal) {
  if (focal <= 0) return 1;
  const float here = static_cast<float>(samples) * std::min(camera.focal_x, camera.focal_y);
  return std::max(1.0F, here / (static_cast<float>(per_side) * focal));
}

Camera<float> camera_of(const Camera<float>& camera, int per_side) {
  const auto n = static_cast<float>(per_side);
  Camera<float> fine = camera;
  fine.width *= per_side;
  fine.height *= per_side;
  for (float* value : {&fine.focal_x, &fine.focal_y, &fine.centre_x, &fine.centre_y}) *value *= n;
  return fine;
}

void average(const raster::Output& samples, int per_side, raster::Output& picture) {
  average(samples.colour, per_side, picture.colour);
  average(samples.alpha, per_side, picture.alpha);
  average(samples.tint, per_side, picture.tint);
  average(samples.silhouette, per_side, picture.silhouette);
  average(samples.roughness, per_side, picture.roughness);
  average(samples.normal, per_side, picture.normal);
  average(samples.distortion, per_side, picture.distortion);
  const Device device = samples.alpha.device();
  const SamplesOf of = samples_of(picture.alpha, per_side);
  picture.depth.place(device).resize(picture.alpha.shape());
  picture.median_depth.place(device).resize(picture.alpha.shape());
  parallel_for(device, what, picture.depth.size(),
               AverageDepths{of, samples.depth.data(), samples.alpha.data(), picture.depth.data()});
  parallel_for(device, what, picture.depth.size(),
               AverageMedianDepths{of, samples.median_depth.data(), picture.median_depth.data()});
}

void average_backward(const raster::Output& samples, const raster::Output& picture, int per_side,
                      const raster::OutputGradient& grad_picture, raster::OutputGradient& grad_samples) {
  const Device device = samples.alpha.device();
  spread_layer(device, grad_picture.colour, per_side, grad_samples.colour);
  spread_layer(device, grad_picture.tint, per_side, grad_samples.tint);
  spread_layer(device, grad_picture.silhouette, per_side, grad_samples.silhouette);
  spread_layer(device, grad_picture.roughness, per_side, grad_samples.roughness);
  spread_layer(device, grad_picture.normal, per_side, grad_samples.normal);
  spread_layer(device, grad_picture.distortion, per_side, grad_samples.distortion);
  spread_layer(device, grad_picture.alpha, per_side, grad_samples.alpha);
  const SamplesOf of = samples_of(picture.alpha, per_side);
  const auto gradient_of = [&](const Tensor<float>& picture_gradient, Tensor<float>& to) {
    to.place(device).resize(picture_gradient.empty() ? Shape{0} : samples.alpha.shape());
    return !picture_gradient.empty();
  };
  if (gradient_of(grad_picture.depth, grad_samples.depth)) {
    if (grad_samples.alpha.empty()) grad_samples.alpha.reset(samples.alpha.shape());
    parallel_for(device, what, picture.depth.size(),
                 AverageDepthsBackward{of, samples.depth.data(), samples.alpha.data(), picture.depth.data(),
                                       grad_picture.depth.data(), grad_samples.depth.data(),
                                       grad_samples.alpha.data()});
  }
  if (gradient_of(grad_picture.median_depth, grad_samples.median_depth)) {
    parallel_for(
        device, what, picture.median_depth.size(),
        AverageMedianDepthsBackward{of, samples.median_depth.data(), grad_picture.median_depth.data(),
                                    grad_samples.median_depth.data()});
  }
}

}  // namespace traceflow::samples
