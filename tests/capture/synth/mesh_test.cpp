#include "capture/synth/mesh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/random.h"

namespace traceflow::synth {
namespace {

struct Ball {
  std::vector<Mesh::Triangle> triangles;
  std::vector<Vector> rest;
  std::vector<Vector> deformed;

  Mesh mesh() const { return {triangles, rest, deformed}; }
  std::array<Vector, 3> corners(size_t triangle) const {
    const Mesh::Triangle& t = triangles[triangle];
    return {deformed[static_cast<size_t>(t[0])], deformed[static_cast<size_t>(t[1])],
            deformed[static_cast<size_t>(t[2])]};
  }
};

// A closed surface: a unit sphere of longitudes and latitudes at rest, with dents and bumps when deformed.
// Its poles are rings of triangles with no area.
Ball dented_ball(int columns = 16, int rows = 12) {
  Ball ball;
  const double pi = std::acos(-1.0);
  for (int row = 0; row <= rows; ++row) {
    const double latitude = pi * row / rows;
    const double ring = row == 0 || row == rows ? 0 : std::sin(latitude);
    for (int column = 0; column < columns; ++column) {
      const double longitude = 2 * pi * column / columns;
      const Vector p(ring * std::cos(longitude), ring * std::sin(longitude), std::cos(latitude));
      ball.rest.push_back(p);
      ball.deformed.push_back((1 + 0.2 * std::sin(5 * p.x + 1) * std::cos(4 * p.y)) * p +
                              Vector(0.3 * p.z * p.z, 0, 0));
    }
  }
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const int32_t a = row * columns + column;
      const int32_t b = row * columns + (column + 1) % columns;
      ball.triangles.push_back({a, a + columns, b + columns});
      ball.triangles.push_back({a, b + columns, b});
    }
  }
  return ball;
}

Vector any_direction(Random& random) {
  return normalize(Vector(random.normal(), random.normal(), random.normal()));
}

// Where the ray meets the triangle's plane, and whether that point is on the inner side of all three edges:
// another formula than the mesh's, in long double.
double plain_distance(const std::array<Vector, 3>& corners, const Ray& ray, double nearest) {
  using Long = Vec3<long double>;
  const Long a(corners[0]);
  const Long b(corners[1]);
  const Long c(corners[2]);
  const Long o(ray.origin);
  const Long d(ray.direction);
  const Long n = cross(b - a, c - a);
  if (dot(n, d) == 0) return infinity;
  const long double t = dot(n, a - o) / dot(n, d);
  const Long p = o + t * d;
  const bool is_inside = dot(cross(b - a, p - a), n) >= 0 && dot(cross(c - b, p - b), n) >= 0 &&
                         dot(cross(a - c, p - c), n) >= 0;
  return is_inside && t > nearest ? static_cast<double>(t) : infinity;
}

TEST(SynthMesh, HitsAgreeWithTryingEveryTriangle) {
  const Ball ball = dented_ball();
  const Mesh mesh = ball.mesh();
  Random random(2);
  int hits = 0;
  for (int i = 0; i < 3000; ++i) {
    Ray ray{1.5 * Vector(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)),
            any_direction(random)};
    if (i % 10 == 0) ray.direction = {0, i % 20 == 0 ? 1 : -1, 0};
    const double nearest = i % 3 == 0 ? random.uniform(0, 1) : 0;
    double expected = infinity;
    for (size_t k = 0; k < ball.triangles.size(); ++k)
      expected = std::min(expected, plain_distance(ball.corners(k), ray, nearest));
    const MeshHit found = mesh.hit(ray, nearest);
    if (expected == infinity) {
      EXPECT_EQ(found.distance, infinity) << i;
      EXPECT_EQ(found.triangle, -1);
      continue;
    }
    ++hits;
    ASSERT_NEAR(found.distance, expected, 1e-9) << i;
    const auto corners = ball.corners(static_cast<size_t>(found.triangle));
    EXPECT_NEAR(plain_distance(corners, ray, nearest), expected, 1e-9) << i << ": the triangle that is named";
    const Vector normal = cross(corners[1] - corners[0], corners[2] - corners[0]);
    EXPECT_NEAR(dot(mesh.normal(found.triangle), normalize(normal)), 1, 1e-12);
  }
  EXPECT_GT(hits, 600);
}

TEST(SynthMesh, NoRaySlipsThroughEdgesOrCorners) {
  const Ball ball = dented_ball();
  const Mesh mesh = ball.mesh();
  Random random(4);
  for (const Mesh::Triangle& t : ball.triangles) {
    for (size_t k = 0; k < 3; ++k) {
      const Vector corner = ball.deformed[static_cast<size_t>(t[k])];
      const Vector next = ball.deformed[static_cast<size_t>(t[(k + 1) % 3])];
      // From the middle, which the surface encloses, so that every direction has to hit.
      const Vector target = glm::mix(corner, next, k == 0 ? 0.0 : random.uniform());
      EXPECT_NEAR(mesh.hit({Vector(0), normalize(target)}).distance, length(target), 1e-9);
    }
  }
}

TEST(SynthMesh, NormalsPointOutwards) {
  const Ball ball = dented_ball();
  const Mesh mesh = ball.mesh();
  Random random(6);
  for (int i = 0; i < 200; ++i) {
    const Vector direction = any_direction(random);
    const MeshHit hit = mesh.hit({Vector(0), direction});
    ASSERT_GE(hit.triangle, 0);
    EXPECT_GT(dot(mesh.normal(hit.triangle), direction), 0);
  }
}

TEST(SynthMesh, PointsKeepTheirPlaceInTheirTriangle) {
  const Ball ball = dented_ball();
  const Mesh mesh = ball.mesh();
  Random random(8);
  for (int i = 0; i < 500; ++i) {
    const MeshHit hit = mesh.hit({Vector(0), any_direction(random)});
    ASSERT_GE(hit.triangle, 0);
    const Mesh::Triangle& t = ball.triangles[static_cast<size_t>(hit.triangle)];
    const double a = random.uniform();
    const double b = random.uniform() * (1 - a);
    const auto mixed = [&](const std::vector<Vector>& vertices) {
      return (1 - a - b) * vertices[static_cast<size_t>(t[0])] + a * vertices[static_cast<size_t>(t[1])] +
             b * vertices[static_cast<size_t>(t[2])];
    };
    EXPECT_LT(length(mesh.at_rest(hit.triangle, mixed(ball.deformed)) - mixed(ball.rest)), 1e-12);
    EXPECT_LT(length(mesh.deformed(hit.triangle, mixed(ball.rest)) - mixed(ball.deformed)), 1e-12);
  }
}

TEST(SynthMesh, ReachHoldsEveryVertex) {
  const Ball ball = dented_ball();
  double farthest = 0;
  for (const Vector& vertex : ball.deformed) farthest = std::max(farthest, length(vertex));
  EXPECT_EQ(ball.mesh().bounding_radius(), farthest);
}

TEST(SynthMesh, RaysThatAreNotNumbersHitNothing) {
  const Mesh mesh = dented_ball().mesh();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double one = 1;
  for (const double origin : {nan, infinity, one}) {
    for (const double direction : {nan, infinity, 0.0}) {
      EXPECT_EQ(mesh.hit({Vector(origin), Vector(direction)}).triangle, -1) << origin << ' ' << direction;
    }
  }
  EXPECT_EQ(mesh.hit({{0, nan, 0}, {0, 0, 1}}).triangle, -1);
  EXPECT_EQ(mesh.hit({{0, 0, 0}, {0, nan, 1}}).triangle, -1);
}

TEST(SynthMesh, TrianglesWithoutAreaAreNeverHit) {
  const std::vector<Vector> vertices{{0, 0, 1}, {0.5, 0, 1}, {1, 0, 1}};
  // All in one place of the hierarchy, where no plane can part them.
  std::vector<Mesh::Triangle> triangles(5000, {0, 1, 2});
  triangles.insert(triangles.end(), 5000, {1, 1, 1});
  const Mesh mesh(triangles, vertices, vertices);
  for (const double x : {0.0, 0.25, 0.5, 1.0}) EXPECT_EQ(mesh.hit({{x, 0, 0}, {0, 0, 1}}).triangle, -1);
  EXPECT_EQ(mesh.hit({{-1, 0, 1}, {1, 0, 0}}).triangle, -1) << "along the line";
  EXPECT_EQ(Mesh({}, {}, {}).hit({Vector(0), {0, 0, 1}}).triangle, -1);
}

TEST(SynthMesh, RefusesVerticesThatAreNoPlaces) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<Vector> good{{0, 0, 1}, {0.5, 0, 1}, {1, 0, 1}};
  std::vector<Vector> bad = good;
  bad[1].y = nan;
  EXPECT_THROW(Mesh({{0, 1, 2}}, good, bad), InternalError);
  EXPECT_THROW(Mesh({{0, 1, 2}}, bad, good), InternalError);
  EXPECT_THROW(Mesh({{0, 1, 3}}, good, good), InternalError);
  EXPECT_THROW(Mesh({{0, 1, 2}}, good, {}), InternalError);
}

}  // namespace
}  // namespace traceflow::synth
