#pragma once

#include <cmath>
#include <vector>

#include "math/camera.h"

// What the surface ops share.
namespace traceflow::surface {

// Method §4.1.
template <class T>
T surface_depth(T expected, T median, T depth_ratio) {
  return (T(1) - depth_ratio) * expected + depth_ratio * median;
}

template <class T>
Vec3<T> pixel_ray(const Camera<T>& camera, int64_t row, int64_t column) {
  return camera.ray_in_world(static_cast<T>(column) + T(0.5), static_cast<T>(row) + T(0.5));
}

template <class T>
bool is_finite(const Vec3<T>& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

// The camera's share of dL/d(ray) of one pixel.
template <class T>
void add_ray_gradient(const Camera<T>& camera, int64_t row, int64_t column, const Vec3<T>& grad_ray,
                      CameraGradient<T>& gradient) {
  const Vec3<T> ray = camera.ray_in_camera(static_cast<T>(column) + T(0.5), static_cast<T>(row) + T(0.5));
  gradient.camera_from_world += glm::outerProduct(ray, grad_ray);
}

// The camera's share of dL/dx for the point x = eye + z·ray of one pixel.
template <class T>
void add_point_gradient(const Camera<T>& camera, int64_t row, int64_t column, T z, const Vec3<T>& grad_point,
                        CameraGradient<T>& gradient) {
  add_ray_gradient(camera, row, column, z * grad_point, gradient);
  gradient.position += grad_point;
}

// Partial gradients of blocks, added in block order.
template <class T>
void add_in_order(const std::vector<CameraGradient<T>>& partial, CameraGradient<T>& gradient) {
  CameraGradient<T> total;
  for (const CameraGradient<T>& p : partial) {
    total.camera_from_world += p.camera_from_world;
    total.position += p.position;
  }
  gradient.camera_from_world += total.camera_from_world;
  gradient.position += total.position;
}

}  // namespace traceflow::surface
