#include "capture/synth/scene.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace traceflow::synth {

namespace {

double distance_to(const Sphere& sphere, const Ray& ray, double nearest) {
  const double b = dot(ray.origin, ray.direction);
  const double root2 = b * b - dot(ray.origin, ray.origin) + sphere.radius * sphere.radius;
  if (!(root2 >= 0)) return infinity;
  const double root = std::sqrt(root2);
  if (-b - root > nearest) return -b - root;
  return -b + root > nearest ? -b + root : infinity;
}

double distance_to(const Plane&, const Ray& ray, double nearest) {
  if (ray.direction.z == 0) return infinity;
  const double t = -ray.origin.z / ray.direction.z;
  return t > nearest ? t : infinity;
}

double distance_to(const Disk& disk, const Ray& ray, double nearest) {
  const double t = distance_to(Plane{}, ray, nearest);
  if (t == infinity) return t;
  const double x = ray.origin.x + t * ray.direction.x;
  const double y = ray.origin.y + t * ray.direction.y;
  return x * x + y * y <= disk.radius * disk.radius ? t : infinity;
}

double distance_to(const Box& box, const Ray& ray, double nearest) {
  double enter = -infinity;
  double leave = infinity;
  for (int axis = 0; axis < 3; ++axis) {
    const double half = box.half_size[axis];
    if (ray.direction[axis] == 0) {
      if (std::abs(ray.origin[axis]) > half) return infinity;
      continue;
    }
    const double inverse = 1 / ray.direction[axis];
    const double middle = -ray.origin[axis] * inverse;
    const double half_span = half * std::abs(inverse);
    enter = std::max(enter, middle - half_span);
    leave = std::min(leave, middle + half_span);
  }
  if (enter > leave) return infinity;
  if (enter > nearest) return enter;
  return leave > nearest ? leave : infinity;
}

template <class S>
ShapeHit hit_of(const S& shape, const Ray& ray, double nearest) {
  return {distance_to(shape, ray, nearest)};
}
ShapeHit hit_of(const std::shared_ptr<const Mesh>& mesh, const Ray& ray, double nearest) {
  return mesh->hit(ray, nearest);
}

SurfacePoint surface_of(const Sphere& sphere, const Vector& point, int) {
  const Vector normal = point / sphere.radius;
  const double longitude = std::atan2(normal.y, normal.x) / (2 * std::numbers::pi);
  const double latitude = std::acos(std::clamp(normal.z, -1.0, 1.0)) / std::numbers::pi;
  return {normal, {longitude, latitude}, point};
}

SurfacePoint surface_of(const Disk&, const Vector& point, int) {
  return {{0, 0, 1}, {point.x, point.y}, point};
}
SurfacePoint surface_of(const Plane&, const Vector& point, int) {
  return {{0, 0, 1}, {point.x, point.y}, point};
}

SurfacePoint surface_of(const Box& box, const Vector& point, int) {
  int face = 0;
  for (int axis = 1; axis < 3; ++axis) {
    if (std::abs(point[axis]) - box.half_size[axis] > std::abs(point[face]) - box.half_size[face])
      face = axis;
  }
  Vector normal(0);
  normal[face] = point[face] < 0 ? -1 : 1;
  return {normal, {point[(face + 1) % 3], point[(face + 2) % 3]}, point};
}

SurfacePoint surface_of(const std::shared_ptr<const Mesh>& mesh, const Vector& point, int triangle) {
  const Vector rest = mesh->at_rest(triangle, point);
  return {mesh->normal(triangle), {rest.x, rest.y}, rest};
}

double bounding_radius_of(const Sphere& sphere) { return sphere.radius; }
double bounding_radius_of(const Disk& disk) { return disk.radius; }
double bounding_radius_of(const Box& box) { return length(box.half_size); }
double bounding_radius_of(const Plane&) { return infinity; }
double bounding_radius_of(const std::shared_ptr<const Mesh>& mesh) { return mesh->bounding_radius(); }

}  // namespace

ShapeHit hit_shape(const Shape& shape, const Ray& ray_in_body, double nearest) {
  return std::visit([&](const auto& s) { return hit_of(s, ray_in_body, nearest); }, shape);
}

double hit_distance(const Shape& shape, const Ray& ray_in_body, double nearest) {
  return hit_shape(shape, ray_in_body, nearest).distance;
}

SurfacePoint surface_at(const Shape& shape, const Vector& point_in_body, int triangle) {
  return std::visit([&](const auto& s) { return surface_of(s, point_in_body, triangle); }, shape);
}

Mat3<double> rotation_about(const Vector& axis, double angle) {
  const double s = std::sin(angle);
  const double c = std::cos(angle);
  Mat3<double> rotation(c);
  for (int column = 0; column < 3; ++column) {
    Vector unit(0);
    unit[column] = 1;
    rotation[column] = c * unit + s * cross(axis, unit) + (1 - c) * axis[column] * axis;
  }
  return rotation;
}

Body::Body(const Shape& of_shape, const Material& of_material, const Pose& at_pose)
    : shape(of_shape),
      material(of_material),
      pose(at_pose),
      bounding_radius(std::visit([](const auto& s) { return bounding_radius_of(s); }, of_shape)) {}

Vector point_in_world(const Body& body, const Vector& rest, int triangle) {
  const auto* mesh = std::get_if<std::shared_ptr<const Mesh>>(&body.shape);
  const Vector in_body = mesh == nullptr ? rest : (*mesh)->deformed(triangle, rest);
  return body.pose.world_from_body * in_body + body.pose.position;
}

Stage AnimatedScene::at(double time) const {
  Stage stage;
  stage.light = light;
  stage.ambient = ambient;
  stage.bodies.reserve(actors.size());
  for (const Actor& actor : actors) {
    Body& body = stage.bodies.emplace_back(actor.shape_at ? actor.shape_at(time) : actor.shape,
                                           actor.material, actor.pose_at(time));
    body.object = actor.object;
    body.is_masked = actor.is_masked;
  }
  return stage;
}

}  // namespace traceflow::synth
