#pragma once

#include "math/types.h"

namespace traceflow {

// A pinhole camera (method §2). Camera axes are OpenCV's: x right, y down, z forward; pixel (i, j) has its
// centre at (i + 0.5, j + 0.5). Lengths are in units of the normalised scene. Loading a capture removes
// distortion and skew.
template <class T>
struct Camera {
  int width = 0;
  int height = 0;
  T focal_x = 1, focal_y = 1;       // pixels
  T centre_x = 0, centre_y = 0;     // principal point, pixels
  Mat3<T> camera_from_world{T(1)};  // rotation
  Vec3<T> position{T(0)};           // centre of projection, in world

  TRACEFLOW_HD Vec3<T> point_in_camera(const Vec3<T>& point_in_world) const {
    return camera_from_world * (point_in_world - position);
  }
  // The ray through pixel position (x, y), scaled to camera z = 1.
  TRACEFLOW_HD Vec3<T> ray_in_camera(T x, T y) const {
    return {(x - centre_x) / focal_x, (y - centre_y) / focal_y, T(1)};
  }
  TRACEFLOW_HD Vec3<T> ray_in_world(T x, T y) const { return ray_in_camera(x, y) * camera_from_world; }
  TRACEFLOW_HD Vec2<T> project(const Vec3<T>& point_in_camera) const {
    return {focal_x * point_in_camera.x / point_in_camera.z + centre_x,
            focal_y * point_in_camera.y / point_in_camera.z + centre_y};
  }
  // Returns whether a point in world axes projects into the image, or at most `margin` pixels outside it, and
  // has a camera z greater than near_plane. False if the point is not finite.
  TRACEFLOW_HD bool sees(const Vec3<T>& point_in_world, T near_plane = 0, T margin = 0) const {
    const Vec3<T> x = point_in_camera(point_in_world);
    if (!(x.z > near_plane)) return false;
    const Vec2<T> at = project(x);
    return at.x >= -margin && at.y >= -margin && at.x < static_cast<T>(width) + margin &&
           at.y < static_cast<T>(height) + margin;
  }
};

template <class To, class From>
Camera<To> convert(const Camera<From>& c) {
  return {c.width,
          c.height,
          To(c.focal_x),
          To(c.focal_y),
          To(c.centre_x),
          To(c.centre_y),
          Mat3<To>(c.camera_from_world),
          Vec3<To>(c.position)};
}

// dL/d(camera pose). The nine entries of the rotation are independent; code that updates a pose projects it
// to the rotation group. Ops add to it.
template <class T>
struct CameraGradient {
  Mat3<T> camera_from_world{T(0)};
  Vec3<T> position{T(0)};

  TRACEFLOW_HD CameraGradient& operator+=(const CameraGradient& other) {
    camera_from_world += other.camera_from_world;
    position += other.position;
    return *this;
  }
};

}  // namespace traceflow
