#pragma once

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <vector>

#include "mesh/chamfer.h"
#include "mesh/fusion.h"
#include "viz/cameras/look_at.h"

// Shapes whose depth images are known by formula, and cameras around them.
namespace traceflow::mesh {

using V = Vec3<double>;

struct ShapeHit {
  double t = std::numeric_limits<double>::infinity();  // of the direction given
  V normal{0}, colour{0.5};
};
// From outside, the first hit of the ray from an origin in a direction.
using Shape3 = std::function<ShapeHit(const V& origin, const V& direction)>;

inline Shape3 sphere(const V& centre, double radius) {
  return [=](const V& origin, const V& direction) {
    const V from = origin - centre;
    const double a = dot(direction, direction), b = dot(from, direction);
    const double root2 = b * b - a * (dot(from, from) - radius * radius);
    ShapeHit hit;
    if (!(root2 > 0) || -b - std::sqrt(root2) < 0) return hit;
    hit.t = (-b - std::sqrt(root2)) / a;
    hit.normal = (from + hit.t * direction) / radius;
    hit.colour = 0.5 + 0.5 * hit.normal;
    return hit;
  };
}

inline Shape3 box(const V& low, const V& high) {
  return [=](const V& origin, const V& direction) {
    ShapeHit enter;
    enter.t = 0;
    double leave = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
      const bool forward = direction[axis] > 0;
      const double in = ((forward ? low : high)[axis] - origin[axis]) / direction[axis];
      if (in > enter.t) {
        enter.t = in;
        enter.normal = V(0);
        enter.normal[axis] = forward ? -1 : 1;
      }
      leave = std::min(leave, ((forward ? high : low)[axis] - origin[axis]) / direction[axis]);
    }
    if (!(enter.t > 0 && enter.t < leave)) return ShapeHit();
    return enter;
  };
}

// All that has this z, seen from smaller z.
inline Shape3 wall(double z) {
  return [=](const V& origin, const V& direction) {
    ShapeHit hit;
    if (direction.z <= 0) return hit;
    hit.t = (z - origin.z) / direction.z;
    hit.normal = {0, 0, -1};
    return hit;
  };
}

inline Shape3 first_of(const std::vector<Shape3>& shapes) {
  return [=](const V& origin, const V& direction) {
    ShapeHit first;
    for (const Shape3& shape : shapes) {
      const ShapeHit hit = shape(origin, direction);
      if (hit.t < first.t) first = hit;
    }
    return first;
  };
}

inline Camera<float> camera_at(const V& position, const V& target, int size = 96) {
  Camera<float> camera;
  camera.width = camera.height = size;
  camera.focal_x = camera.focal_y = 1.4F * static_cast<float>(size);
  camera.centre_x = camera.centre_y = 0.5F * static_cast<float>(size);
  const V forward = normalize(target - position);
  return viz::looking(camera, position, forward, viz::perpendicular(forward));
}

// Evenly spread unit vectors.
inline std::vector<V> directions(int count) {
  std::vector<V> result;
  for (int i = 0; i < count; ++i) {
    const double z = 1 - (2 * i + 1) / static_cast<double>(count);
    const double turn = std::numbers::pi * (3 - std::sqrt(5.0)) * i, r = std::sqrt(1 - z * z);
    result.emplace_back(r * std::cos(turn), r * std::sin(turn), z);
  }
  return result;
}

inline DepthView view_of(const Shape3& shape, const Camera<float>& camera) {
  const Shape one{camera.height, camera.width}, three{camera.height, camera.width, 3};
  DepthView view{camera, Tensor<float>(one), Tensor<float>(three), Tensor<float>(three), Tensor<float>(one)};
  const Camera<double> exact = convert<double>(camera);
  for (int64_t i = 0; i < view.depth.size(); ++i) {
    const V ray = exact.ray_in_world(static_cast<double>(i % camera.width) + 0.5,
                                     static_cast<double>(i / camera.width) + 0.5);
    const ShapeHit hit = shape(exact.position, ray);
    if (!std::isfinite(hit.t)) continue;
    view.depth[i] = static_cast<float>(hit.t);
    view.alpha[i] = 1;
    store3(view.normal.data() + 3 * i, hit.normal);
    store3(view.colour.data() + 3 * i, hit.colour);
  }
  return view;
}

inline FusionOptions voxels_of(float voxel) {
  FusionOptions options;
  options.voxel = voxel;
  return options;
}

// The surface fused from cameras all around a target.
inline TriangleMesh fused_around(const Shape3& shape, const V& target, double distance, int cameras,
                                 const FusionOptions& options) {
  Fusion fusion(options);
  for (const V& direction : directions(cameras))
    fusion.integrate(view_of(shape, camera_at(target + distance * direction, target)));
  return fusion.extract();
}

// Twelve triangles with flat normals.
inline TriangleMesh box_mesh(const V& low, const V& high) {
  TriangleMesh mesh;
  mesh.vertices.reset({24, 3});
  mesh.normals.reset({24, 3});
  mesh.colours.reset({24, 3});
  mesh.triangles.reset({12, 3});
  for (int face = 0; face < 6; ++face) {
    const int axis = face / 2, b = (axis + 1) % 3, c = (axis + 2) % 3;
    V normal(0);
    normal[axis] = face % 2 == 0 ? -1 : 1;
    for (int k = 0; k < 4; ++k) {
      V corner = face % 2 == 0 ? low : high;
      corner[b] = (k == 1 || k == 2 ? high : low)[b];
      corner[c] = (k >= 2 ? high : low)[c];
      store3(mesh.vertices.row(4 * face + k), corner);
      store3(mesh.normals.row(4 * face + k), normal);
    }
    const std::array<int, 6> order =
        face % 2 == 0 ? std::array{0, 2, 1, 0, 3, 2} : std::array{0, 1, 2, 0, 2, 3};
    for (int k = 0; k < 6; ++k) mesh.triangles[6 * face + k] = 4 * face + order[static_cast<size_t>(k)];
  }
  return mesh;
}

inline V vertex_of(const TriangleMesh& mesh, int64_t i) { return load3<double>(mesh.vertices.row(i)); }

}  // namespace traceflow::mesh
