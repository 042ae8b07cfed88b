#pragma once

#include <numbers>

#include "capture/synth/scene.h"

// What the named scenes share: a closed room of 3.4 × 3.4 × 2.3 m around the origin with its light, furniture
// by the walls, and short names for materials and static objects.
namespace traceflow::synth {

inline constexpr double pi = std::numbers::pi;
inline const Vector axis_x(1, 0, 0);
inline const Vector axis_y(0, 1, 0);
inline const Vector axis_z(0, 0, 1);

Texture plain(const Vector& colour);
Texture patterned(Pattern pattern, const Vector& first, const Vector& second, const Vec2<double>& frequency,
                  double grain = 0.35);
Material matt(const Texture& texture);
Material mirror(const Vector& tint);

Actor still(const Shape& shape, const Material& material, const Vector& position,
            const Mat3<double>& rotation = Mat3<double>(1));
// A box on the floor, rotated about the vertical.
Actor standing_box(const Texture& texture, const Vector& half_size, const Vec2<double>& place, double angle);
Actor resting_ball(const Texture& texture, double radius, const Vec2<double>& place, double angle);

// Six walls that face inwards. Each has its own pattern, so that a reflection shows where it comes from.
void add_room(AnimatedScene& scene);
void add_light(AnimatedScene& scene);
// Furniture by the walls, out of the camera's path: most of it is seen only in reflections.
void add_far_clutter(AnimatedScene& scene);

CameraArc arc_around(const Vector& target, double distance, double elevation);
// The camera path of `balls`, also used by `tumble` and `soft`.
CameraArc arc_of_balls();

}  // namespace traceflow::synth
