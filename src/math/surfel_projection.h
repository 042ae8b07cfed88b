#pragma once

#include "math/camera.h"
#include "math/surfel_hit.h"

// A surfel as seen by the camera's pixels (method §3.1): the hit as ratios of linear forms in the pixel's
// ray. The numbers are the same as those of intersect() with the camera's position and ray_in_world(), with
// few operations per pixel.
namespace traceflow {

// For r = ray_in_camera(x, y): u = u·r / w·r, v = v·r / w·r, z = z_plane / w·r. The signs give z_plane ≥ 0,
// so that a hit is in front of the camera if w·r > 0.
template <class T>
struct SurfelForms {
  Vec3<T> u, v, w;
  T z_plane;
  T sign;  // +1 or -1: w = sign · normal in camera axes
};

template <class T>
TRACEFLOW_HD SurfelForms<T> surfel_forms(const SurfelFrame<T>& s, const Camera<T>& camera) {
  const Vec3<T> from_camera = s.position - camera.position;
  const T plane = dot(s.rotation[2], from_camera);
  const T sign = plane < T(0) ? T(-1) : T(1);
  const Mat3<T> axes = camera.camera_from_world * s.rotation;
  const T along_u = dot(s.rotation[0], from_camera);
  const T along_v = dot(s.rotation[1], from_camera);
  return {(sign / s.scale.x) * (plane * axes[0] - along_u * axes[2]),
          (sign / s.scale.y) * (plane * axes[1] - along_v * axes[2]), sign * axes[2], sign * plane, sign};
}

template <class T>
struct SurfelFormsGradient {
  Vec3<T> from_camera{T(0)};  // by position - camera.position
  Mat3<T> rotation{T(0)};
  Vec2<T> scale{T(0)};
  Mat3<T> camera_from_world{T(0)};
};

// The derivatives by all inputs, from dL/dforms (without its `sign`).
template <class T>
TRACEFLOW_HD SurfelFormsGradient<T> surfel_forms_backward(const SurfelFrame<T>& s, const Camera<T>& camera,
                                                          const SurfelForms<T>& forms,
                                                          const SurfelForms<T>& grad) {
  const Vec3<T> from_camera = s.position - camera.position;
  const T plane = dot(s.rotation[2], from_camera);
  const Mat3<T> axes = camera.camera_from_world * s.rotation;
  const T along_u = dot(s.rotation[0], from_camera);
  const T along_v = dot(s.rotation[1], from_camera);
  const Vec3<T> gu = (forms.sign / s.scale.x) * grad.u;
  const Vec3<T> gv = (forms.sign / s.scale.y) * grad.v;

  const T grad_plane = dot(gu, axes[0]) + dot(gv, axes[1]) + forms.sign * grad.z_plane;
  const T grad_along_u = -dot(gu, axes[2]);
  const T grad_along_v = -dot(gv, axes[2]);
  const Mat3<T> grad_axes(plane * gu, plane * gv, forms.sign * grad.w - along_u * gu - along_v * gv);

  SurfelFormsGradient<T> g;
  g.scale = {-dot(grad.u, forms.u) / s.scale.x, -dot(grad.v, forms.v) / s.scale.y};
  g.from_camera = grad_along_u * s.rotation[0] + grad_along_v * s.rotation[1] + grad_plane * s.rotation[2];
  // axes = camera_from_world · rotation
  for (int a = 0; a < 3; ++a) {
    g.rotation[a] = grad_axes[a] * camera.camera_from_world;
    g.camera_from_world += outerProduct(grad_axes[a], s.rotation[a]);
  }
  g.rotation[0] += grad_along_u * from_camera;
  g.rotation[1] += grad_along_v * from_camera;
  g.rotation[2] += grad_plane * from_camera;
  return g;
}

// dL/dpoint_in_camera from dL/d(projected point).
template <class T>
TRACEFLOW_HD Vec3<T> project_backward(const Camera<T>& camera, const Vec3<T>& point_in_camera,
                                      const Vec2<T>& grad_pixel) {
  const T gx = grad_pixel.x * camera.focal_x / point_in_camera.z;
  const T gy = grad_pixel.y * camera.focal_y / point_in_camera.z;
  return {gx, gy, -(gx * point_in_camera.x + gy * point_in_camera.y) / point_in_camera.z};
}

}  // namespace traceflow
