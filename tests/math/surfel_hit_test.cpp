#include "math/surfel_hit.h"

#include <gtest/gtest.h>

#include "math/finite_differences.h"
#include "math/random_vector.h"
#include "math/rotation.h"
#include "math/surfel_projection.h"

namespace traceflow {
namespace {

SurfelFrame<double> random_frame(Random& random) {
  return {random_vector(random),
          rotation_from_quaternion(
              Vec4<double>(random.normal(), random.normal(), random.normal(), random.normal())),
          {random.uniform(0.2, 2), random.uniform(0.2, 2)}};
}

Camera<double> random_camera(Random& random) {
  const Vec4<double> q(random.normal(), random.normal(), random.normal(), random.normal());
  return {40, 30, 33, 37, 18, 16, rotation_from_quaternion(q), random_vector(random)};
}

TEST(SurfelHit, lies_on_the_ray_and_in_the_plane) {
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const auto s = random_frame(random);
    const auto origin = random_vector(random);
    const auto direction = random_vector(random);
    const auto hit = intersect(s, origin, direction);
    ASSERT_TRUE(hit.valid);
    const auto on_ray = origin + hit.t * direction;
    const auto in_plane = s.position + hit.u * s.scale.x * s.rotation[0] + hit.v * s.scale.y * s.rotation[1];
    EXPECT_LT(length(on_ray - in_plane), 1e-9 * (1 + length(on_ray)));
  }
}

TEST(SurfelHit, a_ray_in_the_plane_has_no_hit) {
  const SurfelFrame<double> s{Vec3<double>(0.0), Mat3<double>(1.0), {1, 1}};
  EXPECT_FALSE(intersect(s, Vec3<double>(0, 0, 1), Vec3<double>(1, 0, 0)).valid);
}

TEST(SurfelHit, backward_matches_central_differences) {
  Random random(2);
  for (int i = 0; i < 20; ++i) {
    SCOPED_TRACE(i);
    auto s = random_frame(random);
    auto origin = random_vector(random);
    auto direction = random_vector(random);
    direction += s.rotation[2] * (dot(s.rotation[2], direction) < 0 ? -1.0 : 1.0);  // away from grazing
    const auto g = random_vector(random);
    const auto loss = [&] {
      const auto hit = intersect(s, origin, direction);
      return g.x * hit.t + g.y * hit.u + g.z * hit.v;
    };
    const auto grad =
        intersect_backward(s, origin, direction, intersect(s, origin, direction), g.x, g.y, g.z);
    for (int a = 0; a < 3; ++a) {
      expect_derivative(grad.position[a], s.position[a], loss, "position");
      expect_derivative(grad.origin[a], origin[a], loss, "origin");
      expect_derivative(grad.direction[a], direction[a], loss, "direction");
      for (int b = 0; b < 3; ++b) expect_derivative(grad.rotation[a][b], s.rotation[a][b], loss, "rotation");
    }
    for (int a = 0; a < 2; ++a) expect_derivative(grad.scale[a], s.scale[a], loss, "scale");
  }
}

TEST(SurfelForms, give_the_hit_of_every_pixel) {
  Random random(3);
  for (int i = 0; i < 100; ++i) {
    const auto s = random_frame(random);
    const auto camera = random_camera(random);
    const double x = random.uniform(0, 40);
    const double y = random.uniform(0, 30);
    const auto hit = intersect(s, camera.position, camera.ray_in_world(x, y));
    const auto forms = surfel_forms(s, camera);
    const auto ray = camera.ray_in_camera(x, y);
    const double w = dot(forms.w, ray);
    EXPECT_GE(forms.z_plane, 0);
    EXPECT_NEAR(forms.z_plane / w, hit.t, 1e-9 * (1 + std::abs(hit.t)));
    EXPECT_NEAR(dot(forms.u, ray) / w, hit.u, 1e-8 * (1 + std::abs(hit.u)));
    EXPECT_NEAR(dot(forms.v, ray) / w, hit.v, 1e-8 * (1 + std::abs(hit.v)));
  }
}

TEST(SurfelForms, backward_matches_central_differences) {
  Random random(4);
  for (int i = 0; i < 20; ++i) {
    SCOPED_TRACE(i);
    auto s = random_frame(random);
    auto camera = random_camera(random);
    const SurfelForms<double> g{random_vector(random), random_vector(random), random_vector(random),
                                random.normal(), 0};
    const auto loss = [&] {
      const auto f = surfel_forms(s, camera);
      return dot(g.u, f.u) + dot(g.v, f.v) + dot(g.w, f.w) + g.z_plane * f.z_plane;
    };
    const auto grad = surfel_forms_backward(s, camera, surfel_forms(s, camera), g);
    for (int a = 0; a < 3; ++a) {
      expect_derivative(grad.from_camera[a], s.position[a], loss, "position");
      expect_derivative(-grad.from_camera[a], camera.position[a], loss, "camera position");
      for (int b = 0; b < 3; ++b) {
        expect_derivative(grad.rotation[a][b], s.rotation[a][b], loss, "rotation");
        expect_derivative(grad.camera_from_world[a][b], camera.camera_from_world[a][b], loss,
                          "camera rotation");
      }
    }
    for (int a = 0; a < 2; ++a) expect_derivative(grad.scale[a], s.scale[a], loss, "scale");
  }
}

TEST(Projection, backward_matches_central_differences) {
  Random random(5);
  const auto camera = random_camera(random);
  Vec3<double> point(0.3, -0.7, 2.5);
  const Vec2<double> g(0.8, -1.3);
  const auto grad = project_backward(camera, point, g);
  for (int a = 0; a < 3; ++a) {
    expect_derivative(
        grad[a], point[a], [&] { return dot(g, camera.project(point)); }, "point");
  }
}

}  // namespace
}  // namespace traceflow
