#pragma once

#include <functional>
#include <memory>
#include <variant>
#include <vector>

#include "capture/synth/mesh.h"
#include "capture/synth/ray.h"
#include "capture/synth/texture.h"

// What a synthetic capture shows: shapes with materials, each with a pose that is a function of time. Metres,
// world z up.
namespace traceflow::synth {

// Shapes are in their own frame, centred at its origin.
struct Sphere {
  double radius;
};
// In the xy plane, normal +z.
struct Disk {
  double radius;
};
struct Box {
  Vector half_size;
};
// The whole xy plane, normal +z: a wall.
struct Plane {};
using Shape = std::variant<Sphere, Disk, Box, Plane, std::shared_ptr<const Mesh>>;

// A ray's hit with a shape: distance in units of the ray's direction, infinite for a miss; the triangle of a
// mesh, -1 for other shapes.
using ShapeHit = MeshHit;
// First hit beyond `nearest`.
ShapeHit hit_shape(const Shape& shape, const Ray& ray_in_body, double nearest = 0);
double hit_distance(const Shape& shape, const Ray& ray_in_body, double nearest = 0);

// Outward normal and texture position of a point on the shape, and the material point at rest: on a mesh
// before its deformation, on other shapes the point itself. uv is in metres on flat shapes, in turns on
// spheres (longitude / 2π, latitude from the pole / π), and x and y at rest on meshes.
struct SurfacePoint {
  Vector normal;
  Vec2<double> uv;
  Vector rest;
};
// triangle: from the hit.
SurfacePoint surface_at(const Shape& shape, const Vector& point_in_body, int triangle = -1);

// A diffuse base under a specular coat. The coat reflects `specular` at normal incidence and more at grazing
// angles (Schlick); the base gets the rest. roughness is the radius of the lobe around the mirror direction.
struct Material {
  Texture albedo;
  Vector specular{0};
  double roughness = 0;
  Vector emission{0};

  bool is_specular() const { return specular.x > 0 || specular.y > 0 || specular.z > 0; }
};

// x_in_world = world_from_body · x_in_body + position.
struct Pose {
  Vector position{0};
  Mat3<double> world_from_body{1};
};
// Right-handed rotation about a unit axis.
Mat3<double> rotation_about(const Vector& axis, double angle);

struct Body {
  Body(const Shape& of_shape, const Material& of_material, const Pose& at_pose);

  Shape shape;
  Material material;
  Pose pose;
  double bounding_radius;  // radius of the sphere around the pose's position that contains the body; infinite
                           // for planes
  int object = -1;         // the moving object that it belongs to; -1: it never moves
  bool is_masked = false;  // whether the masks show it
};
// World position of a material point of a body: `rest` and `triangle` select the point.
Vector point_in_world(const Body& body, const Vector& rest, int triangle);

// The scene at one time.
struct Stage {
  std::vector<Body> bodies;
  int light = -1;      // the emitting disk among the bodies that lights the others; -1: none
  double ambient = 0;  // radiance that reaches every point from all directions
};

// Bodies that move together are one object. Objects are numbered 0, 1, ….
struct Actor {
  Shape shape;
  Material material;
  std::function<Pose(double)> pose_at;  // of time in [0, 1]
  int object = -1;
  bool is_masked = false;
  std::function<Shape(double)> shape_at =
      nullptr;  // for deforming shapes, instead of `shape`; the triangles stay the same
};

// The camera's arc around a target. Azimuth is measured from -y towards +x.
struct CameraArc {
  Vector target{0};
  double distance = 1;
  double half_angle = 0.6;        // the azimuth moves forth and back over ± this, radians
  double elevation = 0.25;        // mean, radians
  double elevation_swing = 0.06;  // radians
  double test_azimuth = 0.06;     // azimuth of the right camera relative to the left, radians
};

struct AnimatedScene {
  std::vector<Actor> actors;
  int light = -1;
  double ambient = 0;
  CameraArc arc;

  Stage at(double time) const;
};

}  // namespace traceflow::synth
