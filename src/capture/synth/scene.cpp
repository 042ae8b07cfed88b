#include "capture/synth/scene.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "capture/synth/sampler.h"

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
    const double reach = half * std::abs(inverse);
    enter = std::max(enter, middle - reach);
    leave = std::min(leave, middle + reach);
  }
  if (enter > leave) return infinity;
  if (enter > nearest) return enter;
  return leave > nearest ? leave : infinity;
}

SurfacePoint surface_of(const Sphere& sphere, const Vector& point) {
  const Vector normal = point / sphere.radius;
  const double longitude = std::atan2(normal.y, normal.x) / (2 * std::numbers::pi);
  const double latitude = std::acos(std::clamp(normal.z, -1.0, 1.0)) / std::numbers::pi;
  return {normal, {longitude, latitude}};
}

SurfacePoint surface_of(const Disk&, const Vector& point) { return {{0, 0, 1}, {point.x, point.y}}; }
SurfacePoint surface_of(const Plane&, const Vector& point) { return {{0, 0, 1}, {point.x, point.y}}; }

SurfacePoint surface_of(const Box& box, const Vector& point) {
  int face = 0;
  for (int axis = 1; axis < 3; ++axis) {
    if (std::abs(point[axis]) - box.half_size[axis] > std::abs(point[face]) - box.half_size[face])
      face = axis;
  }
  Vector normal(0);
  normal[face] = point[face] < 0 ? -1 : 1;
  return {normal, {point[(face + 1) % 3], point[(face + 2) % 3]}};
}

double lattice_value(int64_t x, int64_t y) {
  return unit_from_bits(
      mix_bits(static_cast<uint64_t>(x) * 0x9E3779B97F4A7C15ULL + static_cast<uint64_t>(y)));
}

// Value noise in [0, 1] on the unit lattice.
double smooth_noise(double x, double y) {
  const double floor_x = std::floor(x);
  const double floor_y = std::floor(y);
  const auto i = static_cast<int64_t>(floor_x);
  const auto j = static_cast<int64_t>(floor_y);
  const double fx = x - floor_x;
  const double fy = y - floor_y;
  const double wx = fx * fx * (3 - 2 * fx);
  const double wy = fy * fy * (3 - 2 * fy);
  return std::lerp(std::lerp(lattice_value(i, j), lattice_value(i + 1, j), wx),
                   std::lerp(lattice_value(i, j + 1), lattice_value(i + 1, j + 1), wx), wy);
}

double grain_at(const Vec2<double>& p) {
  return 0.65 * smooth_noise(p.x, p.y) + 0.35 * smooth_noise(2.7 * p.x + 17, 2.7 * p.y + 31);
}

double reach_of(const Sphere& sphere) { return sphere.radius; }
double reach_of(const Disk& disk) { return disk.radius; }
double reach_of(const Box& box) { return length(box.half_size); }
double reach_of(const Plane&) { return infinity; }

bool is_odd(double cell) { return std::fmod(cell, 2.0) != 0; }

// Mortar lines a tenth of a brick's height wide, every second row shifted by half a brick.
bool is_mortar(const Vec2<double>& p) {
  const double row = std::floor(p.y);
  const double x = p.x + (is_odd(row) ? 0.5 : 0.0);
  return p.y - row < 0.12 || x - std::floor(x) < 0.06;
}

bool shows_second(Pattern pattern, const Vec2<double>& p) {
  switch (pattern) {
    case Pattern::plain:
      return false;
    case Pattern::checker:
      return is_odd(std::floor(p.x) + std::floor(p.y));
    case Pattern::stripes:
      return is_odd(std::floor(p.x + p.y));
    case Pattern::bricks:
      return is_mortar(p);
  }
  return false;
}

}  // namespace

double hit_distance(const Shape& shape, const Ray& ray_in_body, double nearest) {
  return std::visit([&](const auto& s) { return distance_to(s, ray_in_body, nearest); }, shape);
}

SurfacePoint surface_at(const Shape& shape, const Vector& point_in_body) {
  return std::visit([&](const auto& s) { return surface_of(s, point_in_body); }, shape);
}

Vector colour_at(const Texture& texture, const Vec2<double>& uv) {
  const Vector colour =
      shows_second(texture.pattern, uv * texture.frequency) ? texture.second : texture.first;
  if (texture.grain == 0) return colour;
  return colour * (1 - texture.grain * grain_at(uv * texture.grain_frequency));
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
      reach(std::visit([](const auto& s) { return reach_of(s); }, of_shape)) {}

Stage AnimatedScene::at(double time) const {
  Stage stage;
  stage.light = light;
  stage.ambient = ambient;
  stage.bodies.reserve(actors.size());
  for (const Actor& actor : actors)
    stage.bodies.emplace_back(actor.shape, actor.material, actor.pose_at(time));
  return stage;
}

}  // namespace traceflow::synth
