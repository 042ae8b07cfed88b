#include "capture/synth/trace.h"

#include <cmath>
#include <numbers>

namespace traceflow::synth {

namespace {

// Offset of a ray's origin from the surface that it leaves, metres.
constexpr double lift = 1e-7;

bool can_reach(const Body& body, const Ray& ray, double farthest) {
  const Vector to_body = body.pose.position - ray.origin;
  const double along = dot(to_body, ray.direction);
  const double off2 = dot(to_body, to_body) - along * along;
  return off2 <= body.bounding_radius * body.bounding_radius * (1 + 1e-9) && along >= -body.bounding_radius &&
         along - body.bounding_radius <= farthest;
}

Ray in_body(const Pose& pose, const Ray& ray) {
  return {(ray.origin - pose.position) * pose.world_from_body, ray.direction * pose.world_from_body};
}

// The body's hit along the ray if it is nearer than `farthest`; otherwise any larger distance.
ShapeHit body_hit(const Body& body, const Ray& ray, double farthest) {
  if (std::holds_alternative<Plane>(body.shape)) {
    const Vector& normal = body.pose.world_from_body[2];
    const double t = dot(normal, body.pose.position - ray.origin) / dot(normal, ray.direction);
    return {t > 0 ? t : infinity};
  }
  return can_reach(body, ray, farthest) ? hit_shape(body.shape, in_body(body.pose, ray)) : ShapeHit{};
}

Hit describe(const Stage& stage, const Ray& ray, int index, const ShapeHit& found) {
  const Body& body = stage.bodies[static_cast<size_t>(index)];
  const Ray local = in_body(body.pose, ray);
  const double distance = found.distance;
  const SurfacePoint surface =
      surface_at(body.shape, local.origin + distance * local.direction, found.triangle);
  Vector normal = body.pose.world_from_body * surface.normal;
  if (dot(normal, ray.direction) > 0) normal = -normal;
  return {distance,     index,         ray.origin + distance * ray.direction, normal, surface.uv,
          surface.rest, found.triangle};
}

// Two unit vectors that complete a unit vector to a right-handed frame (Duff et al. 2017).
void complete_frame(const Vector& n, Vector& u, Vector& v) {
  const double sign = std::copysign(1.0, n.z);
  const double a = -1 / (sign + n.z);
  const double b = n.x * n.y * a;
  u = {1 + sign * n.x * n.x * a, sign * b, -sign * n.x};
  v = {b, sign + n.y * n.y * a, -n.y};
}

Vector mirror_direction(const Vector& direction, const Vector& normal, double roughness, Sampler& sampler) {
  const Vector ideal = direction - 2 * dot(direction, normal) * normal;
  if (roughness == 0) return ideal;
  const Vec2<double> p = roughness * disk_point(sampler.next());
  Vector u;
  Vector v;
  complete_frame(ideal, u, v);
  const Vector jittered = normalize(ideal + p.x * u + p.y * v);
  return dot(jittered, normal) > 0 ? jittered : ideal;
}

// Light from one point of the light disk at a surface, over π: what a white surface would reflect.
Vector direct_light(const Stage& stage, const Hit& hit, const Vec2<double>& square) {
  const Body& light = stage.bodies[static_cast<size_t>(stage.light)];
  const double radius = std::get<Disk>(light.shape).radius;
  const Vec2<double> p = radius * disk_point(square);
  const Vector light_point = light.pose.position + light.pose.world_from_body * Vector(p, 0);
  const Vector to_light = light_point - hit.point;
  const double distance2 = dot(to_light, to_light);
  const double facing = dot(to_light, hit.normal);
  const double light_facing = std::abs(dot(to_light, light.pose.world_from_body[2]));
  if (!(facing > 0) || hit.body == stage.light) return Vector(0);
  if (is_shadowed(stage, hit.point + lift * hit.normal, light_point)) return Vector(0);
  return light.material.emission * (facing * light_facing * radius * radius / (distance2 * distance2));
}

Vector diffuse_light(const Stage& stage, const Hit& hit, const Material& material, Sampler& sampler) {
  Vector light(stage.ambient);
  if (stage.light >= 0) light += direct_light(stage, hit, sampler.next());
  return colour_at(material.albedo, hit.uv, hit.rest) * light;
}

}  // namespace

std::optional<Hit> nearest_hit(const Stage& stage, const Ray& ray) {
  ShapeHit best;
  int best_body = -1;
  for (size_t i = 0; i < stage.bodies.size(); ++i) {
    const ShapeHit hit = body_hit(stage.bodies[i], ray, best.distance);
    if (hit.distance < best.distance) {
      best = hit;
      best_body = static_cast<int>(i);
    }
  }
  if (best_body < 0) return std::nullopt;
  return describe(stage, ray, best_body, best);
}

bool is_shadowed(const Stage& stage, const Vector& point, const Vector& light_point) {
  const double distance = length(light_point - point);
  const Ray ray{point, (light_point - point) / distance};
  for (size_t i = 0; i < stage.bodies.size(); ++i) {
    const Body& body = stage.bodies[i];
    if (static_cast<int>(i) == stage.light || std::holds_alternative<Plane>(body.shape)) continue;
    if (body_hit(body, ray, distance).distance < distance) return true;
  }
  return false;
}

Vector coat_reflectance(const Material& material, double cosine) {
  if (!material.is_specular()) return Vector(0);
  const double c = 1 - std::abs(cosine);
  const double grazing = c * c * c * c * c;
  return material.specular + grazing * (1.0 - material.specular);
}

Radiance trace_path(const Stage& stage, const Ray& first, Sampler& sampler) {
  Radiance seen;
  Ray ray = first;
  Vector throughput(1);
  for (int bounce = 0;; ++bounce) {
    Vector& part = bounce == 0 ? seen.diffuse : seen.specular;
    const std::optional<Hit> hit = nearest_hit(stage, ray);
    if (!hit) {
      part += throughput * stage.ambient;
      return seen;
    }
    const Material& material = stage.bodies[static_cast<size_t>(hit->body)].material;
    const Vector coat = coat_reflectance(material, dot(ray.direction, hit->normal));
    part += throughput * (material.emission + (1.0 - coat) * diffuse_light(stage, *hit, material, sampler));
    if (!material.is_specular()) return seen;
    throughput *= coat;
    if (bounce == max_bounces) {
      seen.specular += throughput * stage.ambient;
      return seen;
    }
    ray = {hit->point + lift * hit->normal,
           mirror_direction(ray.direction, hit->normal, material.roughness, sampler)};
  }
}

}  // namespace traceflow::synth
