#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "base/random.h"
#include "capture/synth/motion_case.h"

namespace traceflow {
namespace {

using synth::Vector;

class SynthThings : public testing::TestWithParam<SynthScene> {};
INSTANTIATE_TEST_SUITE_P(All, SynthThings, testing::Values(SynthScene::tumble, SynthScene::soft));

TEST_P(SynthThings, StayInViewOfAllTrainingCameras) {
  const SynthOptions options = motion_options(GetParam());
  const SynthMotion motion = synth_motion(options);
  const synth::AnimatedScene scene = synth::make_scene(options.scene);
  int64_t inside = 0;
  int64_t all = 0;
  for (const SynthView& view : training_views(options)) {
    const synth::Stage stage = scene.at(view.time);
    std::map<int, int> visible;
    for (int64_t i = 0; i < motion.object.size(); ++i) {
      const Vector point = point_at(motion, view.frame, i);
      const Vector in_camera = view.camera.point_in_camera(point);
      ASSERT_GT(in_camera.z, 0.5);
      const Vec2<double> pixel = view.camera.project(in_camera);
      const bool is_inside =
          pixel.x >= 0 && pixel.y >= 0 && pixel.x < options.width && pixel.y < options.height;
      ++all;
      inside += is_inside ? 1 : 0;
      if (is_inside && seen_at(stage, view, point)) ++visible[motion.object[i]];
    }
    for (const auto& [object, points] : points_of(motion))
      EXPECT_GT(visible[object], 20) << "object " << object << " in frame " << view.frame;
  }
  EXPECT_GT(static_cast<double>(inside), 0.95 * static_cast<double>(all));
}

// Points all over a closed body's surface, in world: where rays towards its middle arrive.
std::vector<Vector> surface_points(const synth::Body& body) {
  Random random(12);
  std::vector<Vector> points;
  for (int i = 0; i < 150; ++i) {
    const Vector direction = normalize(Vector(random.normal(), random.normal(), random.normal()));
    const Vector aside(random.uniform(-0.05, 0.05), random.uniform(-0.05, 0.05), random.uniform(0, 0.4));
    const synth::Ray ray{aside - 3.0 * direction, direction};
    const double t = synth::hit_distance(body.shape, ray);
    if (t == synth::infinity) continue;
    points.push_back(body.pose.world_from_body * (ray.origin + t * direction) + body.pose.position);
  }
  return points;
}

bool is_inside_body(const synth::Body& body, const Vector& point) {
  const Vector local = (point - body.pose.position) * body.pose.world_from_body;
  return crossings(body.shape, {local, normalize(Vector(0.31, 0.17, 0.93))}).size() % 2 == 1;
}

bool is_closed(const synth::Body& body) {
  return !std::holds_alternative<synth::Plane>(body.shape) &&
         !std::holds_alternative<synth::Disk>(body.shape);
}

TEST_P(SynthThings, KeepOutOfEverythingElseAndInTheRoom) {
  const synth::AnimatedScene scene = synth::make_scene(GetParam());
  for (int step = 0; step <= 24; ++step) {
    const synth::Stage stage = scene.at(step / 24.0);
    for (const synth::Body& body : stage.bodies) {
      if (!is_closed(body)) continue;
      for (const Vector& point : surface_points(body)) {
        ASSERT_TRUE(std::abs(point.x) < 1.7 && std::abs(point.y) < 1.7 && point.z < 2.3);
        ASSERT_GT(point.z, -1e-9);
        for (const synth::Body& other : stage.bodies) {
          if (!is_closed(other) || &other == &body || (body.object < 0 && other.object < 0)) continue;
          if (body.object == other.object || length(point - other.pose.position) > other.bounding_radius)
            continue;
          ASSERT_FALSE(is_inside_body(other, point))
              << "step " << step << ": bodies " << &body - stage.bodies.data() << " and "
              << &other - stage.bodies.data();
        }
      }
    }
  }
}

TEST(SynthSoft, KeepsItsVolume) {
  const synth::AnimatedScene scene = synth::make_scene(SynthScene::soft);
  double at_first = 0;
  for (const double time : {0.0, 0.2, 0.25, 0.5, 0.7}) {
    const synth::Stage stage = scene.at(time);
    const auto body = std::ranges::find(stage.bodies, 0, &synth::Body::object);
    ASSERT_NE(body, stage.bodies.end());
    // Rays from below, a little askew of the symmetric mesh, over 0.8 × 0.8 m.
    constexpr int across = 160;
    double volume = 0;
    for (int k = 0; k < across * across; ++k) {
      const int row = k / across;
      const int column = k % across;
      const double x = 0.8 * ((column + 0.512) / across - 0.5);
      const double y = 0.8 * ((row + 0.489) / across - 0.5);
      const std::vector<double> t = crossings(body->shape, {{x, y, -1}, {0, 0, 1}});
      ASSERT_EQ(t.size() % 2, 0U) << "what goes in comes out";
      for (size_t i = 0; i < t.size(); i += 2) volume += (t[i + 1] - t[i]) * 0.64 / (across * across);
    }
    if (time == 0) at_first = volume;
    EXPECT_NEAR(volume / at_first, 1, 0.01) << time;
  }
  EXPECT_GT(at_first, 0.015);
}

}  // namespace
}  // namespace traceflow
