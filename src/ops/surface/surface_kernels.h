#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "math/camera.h"
#include "math/pseudo_normal.h"
#include "math/reflection.h"

// Shared definitions of the surface ops, and their steps for one pixel or ray. Cameras are passed by value.
namespace traceflow::surface {

// The weight of the median depth. It is 0 where there is no median depth, because the transmittance does not
// fall to one half; only the expected depth counts there.
template <class T>
TRACEFLOW_HD T median_share(T median, T depth_ratio) {
  return median > T(0) ? depth_ratio : T(0);
}

// Method §4.1.
template <class T>
TRACEFLOW_HD T surface_depth(T expected, T median, T depth_ratio) {
  const T share = median_share(median, depth_ratio);
  return (T(1) - share) * expected + share * median;
}

template <class T>
TRACEFLOW_HD Vec3<T> pixel_ray(const Camera<T>& camera, int64_t row, int64_t column) {
  return camera.ray_in_world(static_cast<T>(column) + T(0.5), static_cast<T>(row) + T(0.5));
}

// A camera's gradient as a sum over pixels.
template <class T>
struct CameraSum : CameraGradient<T> {
  TRACEFLOW_HD CameraSum& operator+=(const CameraGradient<T>& other) {
    this->camera_from_world += other.camera_from_world;
    this->position += other.position;
    return *this;
  }
};

// Adds one pixel's dL/d(ray) to the camera's gradient.
template <class T>
TRACEFLOW_HD void add_ray_gradient(const Camera<T>& camera, int64_t row, int64_t column,
                                   const Vec3<T>& grad_ray, CameraSum<T>& gradient) {
  const Vec3<T> ray = camera.ray_in_camera(static_cast<T>(column) + T(0.5), static_cast<T>(row) + T(0.5));
  gradient.camera_from_world += glm::outerProduct(ray, grad_ray);
}

// Adds one pixel's dL/dx, for the point x = eye + z·ray, to the camera's gradient.
template <class T>
TRACEFLOW_HD void add_point_gradient(const Camera<T>& camera, int64_t row, int64_t column, T z,
                                     const Vec3<T>& grad_point, CameraSum<T>& gradient) {
  add_ray_gradient(camera, row, column, z * grad_point, gradient);
  gradient.position += grad_point;
}

// Adds the partial gradients of blocks, in block order.
template <class T>
void add_in_order(const std::vector<CameraSum<T>>& partial, CameraGradient<T>& gradient) {
  CameraSum<T> total;
  for (const CameraSum<T>& p : partial) total += p;
  gradient.camera_from_world += total.camera_from_world;
  gradient.position += total.position;
}

// H×W inputs as one image of points.
template <class T>
struct DepthImage {
  Camera<T> camera;
  const T *depth, *median_depth, *alpha;
  T depth_ratio;

  TRACEFLOW_HD int64_t height() const { return camera.height; }
  TRACEFLOW_HD int64_t width() const { return camera.width; }
  TRACEFLOW_HD T z(int64_t row, int64_t column) const {
    const int64_t i = row * camera.width + column;
    return surface_depth(depth[i], median_depth[i], depth_ratio);
  }
  // Relative to the eye, since normals depend only on differences. NaN where nothing was drawn, so that every
  // normal that uses the point becomes zero.
  TRACEFLOW_HD Vec3<T> point(int64_t row, int64_t column) const {
    return alpha[row * camera.width + column] > T(0) ? z(row, column) * pixel_ray(camera, row, column)
                                                     : Vec3<T>(std::numeric_limits<T>::quiet_NaN());
  }
  // Returns whether a pixel is off the border and something was drawn at it.
  TRACEFLOW_HD bool may_have_normal(int64_t row, int64_t column) const {
    return row > 0 && row < height() - 1 && column > 0 && column < width() - 1 &&
           is_finite(point(row, column));
  }
  TRACEFLOW_HD Vec3<T> across(int64_t row, int64_t column) const {
    return point(row, column + 1) - point(row, column - 1);
  }
  TRACEFLOW_HD Vec3<T> down(int64_t row, int64_t column) const {
    return point(row + 1, column) - point(row - 1, column);
  }
};

template <class T>
struct PseudoNormals {
  DepthImage<T> image;
  T* normal;

  TRACEFLOW_HD void operator()(int64_t pixel) const {
    const int64_t row = static_cast<int32_t>(pixel) / image.camera.width;
    const int64_t column = static_cast<int32_t>(pixel) % image.camera.width;
    const bool may = image.may_have_normal(row, column);
    store3(normal + 3 * pixel,
           may ? pseudo_normal(image.across(row, column), image.down(row, column)) : Vec3<T>(T(0)));
  }
};

// A pixel sums over the four normals that it contributes to.
template <class T>
struct PseudoNormalsBackward {
  DepthImage<T> image;
  const T* grad_normal;
  T *grad_depth, *grad_median_depth;

  TRACEFLOW_HD CameraSum<T> operator()(int64_t pixel) const {
    CameraSum<T> camera;
    const int64_t row = static_cast<int32_t>(pixel) / image.camera.width;
    const int64_t column = static_cast<int32_t>(pixel) % image.camera.width;
    Vec3<T> g(T(0));
    g += of_normal(row, column - 1).across;
    g -= of_normal(row, column + 1).across;
    g += of_normal(row - 1, column).down;
    g -= of_normal(row + 1, column).down;
    if (g == Vec3<T>(T(0))) return camera;
    const T grad_z = dot(g, pixel_ray(image.camera, row, column));
    const T share = median_share(image.median_depth[pixel], image.depth_ratio);
    grad_depth[pixel] += (T(1) - share) * grad_z;
    grad_median_depth[pixel] += share * grad_z;
    add_point_gradient(image.camera, row, column, image.z(row, column), g, camera);
    return camera;
  }

  // Zero on the border and outside the image, and where there is no normal.
  TRACEFLOW_HD PseudoNormalGradient<T> of_normal(int64_t row, int64_t column) const {
    if (!image.may_have_normal(row, column)) return {};
    const auto gradient =
        pseudo_normal_backward(image.across(row, column), image.down(row, column),
                               load3<T>(grad_normal + 3 * (row * image.camera.width + column)));
    if (!is_finite(gradient.across) || !is_finite(gradient.down)) return {};
    return gradient;
  }
};

// The input of reflected rays.
template <class T>
struct Mirror {
  Camera<T> camera;
  const int32_t* pixels;
  const T *depth, *median_depth, *normal;
  T depth_ratio;

  TRACEFLOW_HD int64_t row(int64_t i) const { return pixels[i] / camera.width; }
  TRACEFLOW_HD int64_t column(int64_t i) const { return pixels[i] % camera.width; }
  TRACEFLOW_HD Vec3<T> ray(int64_t i) const { return pixel_ray(camera, row(i), column(i)); }
  TRACEFLOW_HD T z(int64_t i) const {
    return surface_depth(depth[pixels[i]], median_depth[pixels[i]], depth_ratio);
  }
  TRACEFLOW_HD Vec3<T> normal_at(int64_t i) const { return load3<T>(normal + 3 * int64_t{pixels[i]}); }
};

template <class T>
struct ReflectionRays {
  Mirror<T> mirror;
  T *origins, *directions;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const Vec3<T> ray = mirror.ray(i);
    const Vec3<T> origin = mirror.camera.position + mirror.z(i) * ray;
    const bool usable = is_finite(origin);
    store3(origins + 3 * i, usable ? origin : mirror.camera.position);
    store3(directions + 3 * i, usable ? reflect(ray, mirror.normal_at(i)) : Vec3<T>(T(0)));
  }
};

template <class T>
struct ReflectionRaysBackward {
  Mirror<T> mirror;
  const T *grad_origins, *grad_directions;
  T *grad_depth, *grad_median_depth, *grad_normal;

  TRACEFLOW_HD CameraSum<T> operator()(int64_t i) const {
    CameraSum<T> camera;
    add(i, camera);
    return camera;
  }

  TRACEFLOW_HD void add(int64_t i, CameraSum<T>& camera) const {
    const int64_t pixel = mirror.pixels[i];
    const Vec3<T> ray = mirror.ray(i);
    const T z = mirror.z(i);
    const Vec3<T> n = mirror.normal_at(i);
    if (!is_finite(mirror.camera.position + z * ray) || reflect(ray, n) == Vec3<T>(T(0))) return;

    const Vec3<T> grad_point = load3<T>(grad_origins + 3 * i);
    const auto mirrored = reflect_backward(ray, n, load3<T>(grad_directions + 3 * i));
    if (!is_finite(grad_point) || !is_finite(mirrored.ray) || !is_finite(mirrored.normal)) return;
    const T grad_z = dot(grad_point, ray);
    const T share = median_share(mirror.median_depth[pixel], mirror.depth_ratio);
    grad_depth[pixel] += (T(1) - share) * grad_z;
    grad_median_depth[pixel] += share * grad_z;
    add3(grad_normal + 3 * pixel, mirrored.normal);
    add_point_gradient(mirror.camera, mirror.row(i), mirror.column(i), z, grad_point, camera);
    add_ray_gradient(mirror.camera, mirror.row(i), mirror.column(i), mirrored.ray, camera);
  }
};

// A pseudo-random number in [0, 1) that depends only on the seed and the pixel (the finaliser of splitmix64).
TRACEFLOW_HD inline double hashed_uniform(uint64_t seed, int64_t pixel) {
  uint64_t z = seed + 0x9E3779B97F4A7C15ULL * (static_cast<uint64_t>(pixel) + 1);
  z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27U)) * 0x94D049BB133111EBULL;
  z ^= z >> 31U;
  return static_cast<double>(z >> 11U) * 0x1.0p-53;
}

// The weight of a traced pixel's gradient (method §4.4); 0 for a pixel that is not traced.
struct TraceWeight {
  const float *alpha, *tint, *normal;
  float min_alpha, min_tint, probe_share;
  bool probes;
  uint64_t seed;

  TRACEFLOW_HD float operator()(int64_t pixel) const {
    if (!(alpha[pixel] >= min_alpha)) return 0;
    const Vec3<float> n = load3<float>(normal + 3 * pixel);
    if (n == Vec3<float>(0) || !is_finite(n)) return 0;
    if (tint[pixel] >= min_tint) return 1;
    return probes && hashed_uniform(seed, pixel) < static_cast<double>(probe_share) ? 1.0F / probe_share : 0;
  }
};

struct IsTraced {
  TraceWeight weight;
  TRACEFLOW_HD bool operator()(int64_t pixel) const { return weight(pixel) != 0; }
};

// The weights of the listed pixels.
struct ListedWeight {
  TraceWeight weight;
  const int32_t* pixel;
  float* listed;
  TRACEFLOW_HD void operator()(int64_t k) const { listed[k] = weight(pixel[k]); }
};

}  // namespace traceflow::surface
