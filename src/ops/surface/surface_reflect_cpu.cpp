#include "base/indices.h"
#include "base/parallel.h"
#include "ops/surface/surface.h"
#include "ops/surface/surface_backward.h"

namespace traceflow::surface {

namespace {

constexpr int64_t rays_per_block = 2048;

template <class T>
void check_shapes(const Camera<T>& camera, const Tensor<int32_t>& pixels, const Tensor<T>& depth,
                  const Tensor<T>& median_depth, const Tensor<T>& normal) {
  require(depth.shape() == Shape({camera.height, camera.width}) && median_depth.shape() == depth.shape() &&
              normal.shape() == Shape({camera.height, camera.width, 3}),
          "depths and normals have the camera's size", depth.shape().to_string());
  require_ascending(pixels, depth.size());
}

}  // namespace

template <class T>
void reflection_rays(const Camera<T>& camera, const Tensor<int32_t>& pixels, const Tensor<T>& depth,
                     const Tensor<T>& median_depth, const Tensor<T>& normal, T depth_ratio,
                     Tensor<T>& origins, Tensor<T>& directions) {
  check_shapes(camera, pixels, depth, median_depth, normal);
  const int64_t count = pixels.size();
  origins.place(depth.device()).resize({count, 3});
  directions.place(depth.device()).resize({count, 3});
  const Mirror<T> mirror{camera,        pixels.data(), depth.data(), median_depth.data(),
                         normal.data(), depth_ratio};
  parallel_for(depth.device(), "surface: reflection rays", count,
               ReflectionRays<T>{mirror, origins.data(), directions.data()}, rays_per_block);
}

template <class T>
void reflection_rays_backward(const Camera<T>& camera, const Tensor<int32_t>& pixels, const Tensor<T>& depth,
                              const Tensor<T>& median_depth, const Tensor<T>& normal, T depth_ratio,
                              const Tensor<T>& grad_origins, const Tensor<T>& grad_directions,
                              Tensor<T>& grad_depth, Tensor<T>& grad_median_depth, Tensor<T>& grad_normal,
                              CameraGradient<T>* grad_camera) {
  check_shapes(camera, pixels, depth, median_depth, normal);
  const int64_t count = pixels.size();
  require(grad_origins.shape() == Shape({count, 3}) && grad_directions.shape() == grad_origins.shape() &&
              grad_depth.shape() == depth.shape() && grad_median_depth.shape() == depth.shape() &&
              grad_normal.shape() == normal.shape(),
          "gradients have the shapes of their values");
  const Mirror<T> mirror{camera,        pixels.data(), depth.data(), median_depth.data(),
                         normal.data(), depth_ratio};
  const ReflectionRaysBackward<T> step{mirror,
                                       grad_origins.data(),
                                       grad_directions.data(),
                                       grad_depth.data(),
                                       grad_median_depth.data(),
                                       grad_normal.data()};
  if (depth.device() == Device::cuda) {
    backward_on_device("surface: reflection rays backward", count, step, grad_camera);
    return;
  }
  std::vector<CameraSum<T>> partial(static_cast<size_t>((count + rays_per_block - 1) / rays_per_block));
  parallel_blocks("surface: reflection rays backward", count, rays_per_block,
                  [&](int64_t begin, int64_t end) {
                    CameraSum<T> sum;
                    for (int64_t i = begin; i < end; ++i) step.add(i, sum);
                    partial[static_cast<size_t>(begin / rays_per_block)] = sum;
                  });
  if (grad_camera != nullptr) add_in_order(partial, *grad_camera);
}

template void reflection_rays(const Camera<float>&, const Tensor<int32_t>&, const Tensor<float>&,
                              const Tensor<float>&, const Tensor<float>&, float, Tensor<float>&,
                              Tensor<float>&);
template void reflection_rays(const Camera<double>&, const Tensor<int32_t>&, const Tensor<double>&,
                              const Tensor<double>&, const Tensor<double>&, double, Tensor<double>&,
                              Tensor<double>&);
template void reflection_rays_backward(const Camera<float>&, const Tensor<int32_t>&, const Tensor<float>&,
                                       const Tensor<float>&, const Tensor<float>&, float,
                                       const Tensor<float>&, const Tensor<float>&, Tensor<float>&,
                                       Tensor<float>&, Tensor<float>&, CameraGradient<float>*);
template void reflection_rays_backward(const Camera<double>&, const Tensor<int32_t>&, const Tensor<double>&,
                                       const Tensor<double>&, const Tensor<double>&, double,
                                       const Tensor<double>&, const Tensor<double>&, Tensor<double>&,
                                       Tensor<double>&, Tensor<double>&, CameraGradient<double>*);

}  // namespace traceflow::surface
