#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <variant>
#include <vector>

#include "math/types.h"

// What a synthetic capture shows: shapes with materials, each moving as a function of time. Metres, world z
// up.
namespace traceflow::synth {

using Vector = Vec3<double>;

// How far a ray that misses goes.
constexpr double infinity = std::numeric_limits<double>::infinity();

// direction has unit length.
struct Ray {
  Vector origin;
  Vector direction;
};

// Shapes in their own frame, centred at its origin.
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
using Shape = std::variant<Sphere, Disk, Box, Plane>;

// Distance of the first hit beyond `nearest`, in units of the ray's direction; infinite where the ray misses.
double hit_distance(const Shape& shape, const Ray& ray_in_body, double nearest = 0);

// Outward normal and texture position of a point on the shape. uv is in metres on flat shapes, on spheres in
// turns (longitude / 2π, latitude from the pole / π).
struct SurfacePoint {
  Vector normal;
  Vec2<double> uv;
};
SurfacePoint surface_at(const Shape& shape, const Vector& point_in_body);

enum class Pattern { plain, checker, stripes, bricks };

// Two colours in a pattern of `frequency` cells per unit of uv; `grain` darkens by smooth noise of up to that
// share, so that no two places look alike.
struct Texture {
  Pattern pattern = Pattern::plain;
  Vector first{0.5};
  Vector second{0.5};
  Vec2<double> frequency{1};
  double grain = 0;
  double grain_frequency = 12;
};
Vector colour_at(const Texture& texture, const Vec2<double>& uv);

// A diffuse base under a mirror coat. The coat reflects the share `specular` at normal incidence, more at
// grazing angles (Schlick), and the base gets the rest; roughness is the radius of the lobe around the mirror
// direction.
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
  double reach;  // radius of the sphere around the pose's position that holds the body; infinite for planes
};

// The scene at one moment.
struct Stage {
  std::vector<Body> bodies;
  int light = -1;      // the emitting disk among the bodies that lights the others; -1: none
  double ambient = 0;  // radiance that reaches every point from everywhere
};

struct Actor {
  Shape shape;
  Material material;
  std::function<Pose(double)> pose_at;  // of time in [0, 1]
};

// The camera's arc around a target. Azimuth is measured from -y towards +x.
struct CameraArc {
  Vector target{0};
  double distance = 1;
  double half_angle = 0.6;        // the azimuth sweeps there and back over ± this, radians
  double elevation = 0.25;        // mean, radians
  double elevation_swing = 0.06;  // radians
  double test_azimuth = 0.06;     // of the right camera against the left, radians
};

struct AnimatedScene {
  std::vector<Actor> actors;
  int light = -1;
  double ambient = 0;
  CameraArc arc;

  Stage at(double time) const;
};

}  // namespace traceflow::synth
