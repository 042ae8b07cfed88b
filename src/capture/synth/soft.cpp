#include <cmath>
#include <utility>

#include "capture/synth/room.h"
#include "capture/synth/scenes.h"

namespace traceflow::synth {

namespace {

const Vector pillar_half_size(0.13, 0.115, 0.22);

// The pillar's deformation at one time. It stretches along its axis at constant volume, and its axis becomes
// a circular arc.
struct Deformation {
  double stretch;     // length of the axis relative to that at rest
  Vec2<double> bend;  // angle between the axis' two ends, radians, towards which the top leans in x and y

  static Deformation at(double time) {
    const double phase = 2 * pi * time;
    const double swell = std::sin(pi * time) * std::sin(pi * time);
    // Most of the stretch happens while the pillar is nearly upright, so that the two deformations together
    // stay near a fifth.
    return {1 + 0.2 * swell * swell * swell, {0.5 * std::sin(phase), 0.16 * std::sin(2 * phase)}};
  }

  // rest: z is 0 at the foot of the axis, which does not move.
  Vector applied(const Vector& rest) const {
    const double top = 2 * pillar_half_size.z;
    const double angle = std::hypot(bend.x, bend.y);
    const Vec2<double> across = Vec2<double>(rest) / std::sqrt(stretch);
    const double along = stretch * rest.z;
    if (angle < 1e-9) return {across, along};
    const Vec2<double> towards = bend / angle;
    const double curvature = angle / (stretch * top);
    const double turned = curvature * along;
    const double offset = dot(across, towards);
    // The arc's centre is 1 / curvature from the axis, on the side to which it bends.
    const double half_sine = std::sin(0.5 * turned);
    const double shift = 2 * half_sine * half_sine / curvature + offset * std::cos(turned);
    const double height = std::sin(turned) / curvature - offset * std::sin(turned);
    return {across + (shift - offset) * towards, height};
  }
};

struct Surface {
  std::vector<Mesh::Triangle> triangles;
  std::vector<Vector> vertices;
};

// One side of a cube, mapped to a box with round edges: x⁴ + y⁴ + z⁴ = 1, scaled. `u` × `v` points outward.
void add_side(Surface& surface, const Vector& u, const Vector& v, int columns, int rows) {
  const auto first = static_cast<int32_t>(surface.vertices.size());
  const Vector out = cross(u, v);
  for (int row = 0; row <= rows; ++row) {
    for (int column = 0; column <= columns; ++column) {
      const Vector on_cube = out + (2.0 * column / columns - 1) * u + (2.0 * row / rows - 1) * v;
      const Vector square = on_cube * on_cube;
      const double size = std::sqrt(std::sqrt(dot(square, square)));
      surface.vertices.push_back(pillar_half_size * (on_cube / size + axis_z));
    }
  }
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const int32_t a = first + row * (columns + 1) + column;
      const int32_t b = a + columns + 1;
      surface.triangles.push_back({a, a + 1, b + 1});
      surface.triangles.push_back({a, b + 1, b});
    }
  }
}

Surface pillar_at_rest() {
  constexpr int around = 32;
  constexpr int high = 56;
  Surface surface;
  for (const double side : {1.0, -1.0}) {
    add_side(surface, side * axis_y, axis_z, around, high);
    add_side(surface, -side * axis_x, axis_z, around, high);
    add_side(surface, side * axis_x, axis_y, around, around);
  }
  return surface;
}

std::shared_ptr<const Mesh> pillar_at(double time) {
  Surface rest = pillar_at_rest();
  const Deformation deformation = Deformation::at(time);
  std::vector<Vector> deformed;
  deformed.reserve(rest.vertices.size());
  for (const Vector& vertex : rest.vertices) deformed.push_back(deformation.applied(vertex));
  return std::make_shared<const Mesh>(std::move(rest.triangles), std::move(rest.vertices),
                                      std::move(deformed));
}

}  // namespace

AnimatedScene soft() {
  AnimatedScene scene;
  add_room(scene);
  add_light(scene);
  const auto add = [&](const Actor& actor) { scene.actors.push_back(actor); };
  Texture patches = patterned(Pattern::patches, Vector(0.08), {0.97, 0.96, 0.93}, Vec2<double>(20), 0.35);
  patches.grain_frequency = 70;
  Actor pillar = still(Plane{}, matt(patches), {0, 0, 0});
  pillar.object = 0;
  pillar.is_masked = true;
  pillar.shape_at = pillar_at;
  add(pillar);

  add(standing_box(patterned(Pattern::checker, {0.76, 0.22, 0.18}, {0.84, 0.80, 0.70}, {16, 16}, 0.15),
                   {0.09, 0.08, 0.12}, {0.34, 0.34}, 0.6));
  add(standing_box(patterned(Pattern::stripes, {0.18, 0.54, 0.28}, {0.78, 0.80, 0.36}, {12, 12}, 0.15),
                   {0.08, 0.07, 0.16}, {-0.42, 0.36}, -0.3));
  add(resting_ball(patterned(Pattern::checker, {0.24, 0.40, 0.74}, {0.84, 0.84, 0.80}, {10, 5}, 0.1), 0.055,
                   {0.20, -0.36}, 0));
  add(standing_box(patterned(Pattern::stripes, {0.62, 0.24, 0.58}, {0.84, 0.78, 0.40}, {0, 24}, 0.15),
                   {0.05, 0.04, 0.04}, {-0.28, -0.34}, 0.7));
  add_far_clutter(scene);
  scene.arc = arc_of_balls();
  return scene;
}

}  // namespace traceflow::synth
