#include "capture/synth/room.h"

namespace traceflow::synth {

namespace {

constexpr double room_half_width = 1.7;
constexpr double room_height = 2.3;

}  // namespace

Texture plain(const Vector& colour) { return {.first = colour}; }

Texture patterned(Pattern pattern, const Vector& first, const Vector& second, const Vec2<double>& frequency,
                  double grain) {
  return {pattern, first, second, frequency, grain};
}

Material matt(const Texture& texture) { return {.albedo = texture}; }

Material mirror(const Vector& tint) { return {.albedo = plain(Vector(0)), .specular = tint}; }

Actor still(const Shape& shape, const Material& material, const Vector& position,
            const Mat3<double>& rotation) {
  return {shape, material, [pose = Pose{position, rotation}](double) { return pose; }};
}

Actor standing_box(const Texture& texture, const Vector& half_size, const Vec2<double>& place, double angle) {
  return still(Box{half_size}, matt(texture), Vector(place, half_size.z), rotation_about(axis_z, angle));
}

Actor resting_ball(const Texture& texture, double radius, const Vec2<double>& place, double angle) {
  return still(Sphere{radius}, matt(texture), Vector(place, radius), rotation_about(axis_z, angle));
}

void add_room(AnimatedScene& scene) {
  const double w = room_half_width;
  const auto wall = [&](const Texture& texture, const Vector& position, const Vector& axis, double angle) {
    scene.actors.push_back(still(Plane{}, matt(texture), position, rotation_about(axis, angle)));
  };
  wall(patterned(Pattern::checker, {0.74, 0.66, 0.52}, {0.46, 0.36, 0.27}, {5, 5}), {0, 0, 0}, axis_x, 0);
  wall(patterned(Pattern::checker, {0.80, 0.79, 0.76}, {0.70, 0.72, 0.76}, {2, 2}, 0.2), {0, 0, room_height},
       axis_x, pi);
  wall(patterned(Pattern::bricks, {0.62, 0.31, 0.22}, {0.78, 0.73, 0.66}, {4, 8}), {0, w, 0}, axis_x, pi / 2);
  wall(patterned(Pattern::checker, {0.32, 0.46, 0.64}, {0.72, 0.75, 0.72}, {3, 3}), {0, -w, 0}, axis_x,
       -pi / 2);
  wall(patterned(Pattern::stripes, {0.32, 0.52, 0.42}, {0.66, 0.72, 0.56}, {0, 4}), {-w, 0, 0}, axis_y,
       pi / 2);
  wall(patterned(Pattern::stripes, {0.70, 0.56, 0.26}, {0.56, 0.32, 0.38}, {3, 3}), {w, 0, 0}, axis_y,
       -pi / 2);
}

void add_light(AnimatedScene& scene) {
  Material material = matt(plain(Vector(0)));
  material.emission = Vector(5.6, 5.5, 5.3);
  scene.light = static_cast<int>(scene.actors.size());
  scene.actors.push_back(still(Disk{0.8}, material, {0, 0, room_height - 0.01}, rotation_about(axis_x, pi)));
  scene.ambient = 0.55;
}

void add_far_clutter(AnimatedScene& scene) {
  const auto add = [&](const Actor& actor) { scene.actors.push_back(actor); };
  add(standing_box(patterned(Pattern::checker, {0.78, 0.20, 0.16}, {0.82, 0.74, 0.30}, {10, 10}),
                   {0.18, 0.12, 0.38}, {-0.42, -1.50}, 0.2));
  add(standing_box(patterned(Pattern::stripes, {0.16, 0.56, 0.60}, {0.80, 0.82, 0.80}, {8, 8}),
                   {0.15, 0.12, 0.52}, {0.40, -1.52}, -0.15));
  add(standing_box(patterned(Pattern::stripes, {0.56, 0.22, 0.56}, {0.82, 0.62, 0.30}, {0, 8}),
                   {0.14, 0.20, 0.42}, {1.42, -0.50}, 0.1));
  add(standing_box(patterned(Pattern::checker, {0.22, 0.50, 0.24}, {0.78, 0.78, 0.40}, {8, 8}),
                   {0.14, 0.22, 0.46}, {-1.42, -0.45}, -0.2));
  add(standing_box(patterned(Pattern::checker, {0.20, 0.28, 0.60}, {0.72, 0.74, 0.80}, {9, 9}),
                   {0.16, 0.13, 0.26}, {-0.62, 0.92}, 0.5));
  add(resting_ball(patterned(Pattern::checker, {0.82, 0.66, 0.16}, {0.70, 0.22, 0.16}, {12, 6}, 0.15), 0.15,
                   {0.64, 0.86}, 0.4));
}

CameraArc arc_around(const Vector& target, double distance, double elevation) {
  CameraArc arc;
  arc.target = target;
  arc.distance = distance;
  arc.half_angle = 0.5;
  arc.elevation = elevation;
  arc.elevation_swing = 0.07;
  arc.test_azimuth = 0.06;
  return arc;
}

CameraArc arc_of_balls() { return arc_around({0, 0, 0.22}, 1.28, 0.28); }

}  // namespace traceflow::synth
