#include "base/indices.h"
#include "base/parallel.h"
#include "math/reflection.h"
#include "ops/surface/surface.h"
#include "ops/surface/surface_kernels.h"

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
  const auto count = pixels.size();
  origins.resize({count, 3});
  directions.resize({count, 3});
  parallel_for(
      "surface: reflection rays", count,
      [&](int64_t i) {
        const int64_t pixel = pixels[i];
        const Vec3<T> ray = pixel_ray(camera, pixel / camera.width, pixel % camera.width);
        const T z = surface_depth(depth[pixel], median_depth[pixel], depth_ratio);
        const Vec3<T> origin = camera.position + z * ray;
        const bool usable = is_finite(origin);
        store3(origins.row(i), usable ? origin : camera.position);
        store3(directions.row(i), usable ? reflect(ray, load3<T>(normal.data() + 3 * pixel)) : Vec3<T>(T(0)));
      },
      rays_per_block);
}

template <class T>
void reflection_rays_backward(const Camera<T>& camera, const Tensor<int32_t>& pixels, const Tensor<T>& depth,
                              const Tensor<T>& median_depth, const Tensor<T>& normal, T depth_ratio,
                              const Tensor<T>& grad_origins, const Tensor<T>& grad_directions,
                              Tensor<T>& grad_depth, Tensor<T>& grad_median_depth, Tensor<T>& grad_normal,
                              CameraGradient<T>* grad_camera) {
  check_shapes(camera, pixels, depth, median_depth, normal);
  const auto count = pixels.size();
  require(grad_origins.shape() == Shape({count, 3}) && grad_directions.shape() == grad_origins.shape() &&
              grad_depth.shape() == depth.shape() && grad_median_depth.shape() == depth.shape() &&
              grad_normal.shape() == normal.shape(),
          "gradients have the shapes of their values");
  std::vector<CameraGradient<T>> partial(static_cast<size_t>((count + rays_per_block - 1) / rays_per_block));
  parallel_blocks("surface: reflection rays backward", count, rays_per_block,
                  [&](int64_t begin, int64_t end) {
                    CameraGradient<T> sum;
                    for (int64_t i = begin; i < end; ++i) {
                      const int64_t pixel = pixels[i];
                      const int64_t row = pixel / camera.width, column = pixel % camera.width;
                      const Vec3<T> ray = pixel_ray(camera, row, column);
                      const T z = surface_depth(depth[pixel], median_depth[pixel], depth_ratio);
                      const Vec3<T> n = load3<T>(normal.data() + 3 * pixel);
                      if (!is_finite(camera.position + z * ray) || reflect(ray, n) == Vec3<T>(T(0))) continue;

                      const Vec3<T> grad_point = load3<T>(grad_origins.row(i));
                      const auto mirrored = reflect_backward(ray, n, load3<T>(grad_directions.row(i)));
                      if (!is_finite(grad_point) || !is_finite(mirrored.ray) || !is_finite(mirrored.normal))
                        continue;
                      const T grad_z = dot(grad_point, ray);
                      grad_depth[pixel] += (T(1) - depth_ratio) * grad_z;
                      grad_median_depth[pixel] += depth_ratio * grad_z;
                      add3(grad_normal.data() + 3 * pixel, mirrored.normal);
                      add_point_gradient(camera, row, column, z, grad_point, sum);
                      add_ray_gradient(camera, row, column, mirrored.ray, sum);
                    }
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
