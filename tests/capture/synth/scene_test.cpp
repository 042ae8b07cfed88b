#include "capture/synth/scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "base/random.h"
#include "capture/synth/sampler.h"
#include "capture/synth/scenes.h"

namespace traceflow::synth {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

Vector random_direction(Random& random) {
  return normalize(Vector(random.normal(), random.normal(), random.normal()));
}

Vector random_place(Random& random, double bounding_radius) {
  return {random.uniform(-bounding_radius, bounding_radius),
          random.uniform(-bounding_radius, bounding_radius),
          random.uniform(-bounding_radius, bounding_radius)};
}

// Positive outside, negative inside; zero on the surface.
double level(const Sphere& sphere, const Vector& p) { return length(p) - sphere.radius; }
double level(const Box& box, const Vector& p) {
  const Vector d = abs(p) - box.half_size;
  return std::max({d.x, d.y, d.z});
}

// First crossing of the level function along the ray, by small steps and bisection: knows nothing of the
// formulas.
template <class S>
double marched_distance(const S& shape, const Ray& ray, double farthest) {
  constexpr double step = 1e-3;
  double before = level(shape, ray.origin);
  for (double t = step; t < farthest; t += step) {
    const double here = level(shape, ray.origin + t * ray.direction);
    if ((before < 0) != (here < 0)) {
      double low = t - step;
      double high = t;
      for (int i = 0; i < 50; ++i) {
        const double middle = 0.5 * (low + high);
        ((level(shape, ray.origin + middle * ray.direction) < 0) == (before < 0) ? low : high) = middle;
      }
      return low;
    }
    before = here;
  }
  return infinity;
}

template <class S>
void expect_hits_agree_with_marching(const S& shape) {
  Random random(7);
  int hits = 0;
  for (int i = 0; i < 400; ++i) {
    const Ray ray{random_place(random, 1.2), random_direction(random)};
    const double expected = marched_distance(shape, ray, 3);
    const double found = hit_distance(shape, ray);
    if (expected == infinity) {
      // A chord shorter than the march's step may be missed by it, never by the formula.
      if (found != infinity) {
        EXPECT_NEAR(level(shape, ray.origin + found * ray.direction), 0, 1e-12);
      }
      continue;
    }
    ++hits;
    EXPECT_NEAR(found, expected, 1e-9) << i;
  }
  EXPECT_GT(hits, 60);
}

TEST(SynthShapes, SphereHitsAgreeWithMarching) { expect_hits_agree_with_marching(Sphere{0.7}); }

TEST(SynthShapes, BoxHitsAgreeWithMarching) { expect_hits_agree_with_marching(Box{{0.5, 0.3, 0.8}}); }

TEST(SynthShapes, SphereHitMatchesTheHandComputedOne) {
  // From (3, 0, 0.6) along -x a unit sphere is met at x = 0.8.
  const Ray ray{{3, 0, 0.6}, {-1, 0, 0}};
  EXPECT_NEAR(hit_distance(Sphere{1}, ray), 2.2, 1e-12);
  EXPECT_NEAR(hit_distance(Sphere{1}, ray, 2.5), 3.8, 1e-12) << "beyond the first hit lies the far side";
  EXPECT_EQ(hit_distance(Sphere{1}, {{3, 0, 0.6}, {1, 0, 0}}), infinity) << "behind";
}

TEST(SynthShapes, DiskEndsAtItsRadius) {
  for (const double offset : {0.0, 0.49, 0.51}) {
    const double t = hit_distance(Disk{0.5}, {{offset, 0, 2}, {0, 0, -1}});
    EXPECT_EQ(t, offset < 0.5 ? 2.0 : infinity);
  }
  const Vector slanted = normalize(Vector(3, 0, -4));
  EXPECT_NEAR(hit_distance(Disk{0.5}, {{-1.2, 0.1, 2}, slanted}), 2.5, 1e-12);
  EXPECT_EQ(hit_distance(Disk{0.5}, {{0, 0, 1}, {1, 0, 0}}), infinity) << "parallel";
}

TEST(SynthShapes, PlaneIsHitFromBothSidesAndNeverBehind) {
  EXPECT_EQ(hit_distance(Plane{}, {{5, 7, 2}, {0, 0, -1}}), 2);
  EXPECT_EQ(hit_distance(Plane{}, {{5, 7, -2}, {0, 0, 1}}), 2);
  EXPECT_EQ(hit_distance(Plane{}, {{5, 7, 2}, {0, 0, 1}}), infinity);
}

TEST(SynthShapes, NormalsAreTheGradientOfTheSurface) {
  Random random(3);
  const Sphere sphere{0.7};
  const Box box{{0.5, 0.3, 0.8}};
  for (int i = 0; i < 200; ++i) {
    const Ray ray{2.0 * random_direction(random), random_direction(random)};
    const auto check = [&](const auto& shape) {
      const double t = hit_distance(shape, ray);
      if (t == infinity) return;
      const Vector p = ray.origin + t * ray.direction;
      const Vector n = surface_at(shape, p).normal;
      Vector gradient;
      for (int axis = 0; axis < 3; ++axis) {
        Vector d(0);
        d[axis] = 1e-6;
        gradient[axis] = (level(shape, p + d) - level(shape, p - d)) / 2e-6;
      }
      EXPECT_NEAR(length(n - gradient), 0, 1e-5);
    };
    check(sphere);
    check(box);
  }
}

TEST(SynthShapes, RaysThatAreNotNumbersHitNothing) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<Shape> shapes{Sphere{1}, Disk{1}, Plane{}};
  for (const Shape& shape : shapes) {
    EXPECT_EQ(hit_distance(shape, {{nan, nan, nan}, {nan, nan, nan}}), infinity);
  }
}

TEST(SynthTextures, CheckerAlternatesAcrossEveryBorder) {
  const Texture checker{Pattern::checker, Vector(1), Vector(0), {4, 4}};
  EXPECT_EQ(colour_at(checker, {0.1, 0.1}), Vector(1));
  EXPECT_EQ(colour_at(checker, {0.3, 0.1}), Vector(0));
  EXPECT_EQ(colour_at(checker, {-0.1, 0.1}), Vector(0));
  EXPECT_EQ(colour_at(checker, {-0.1, -0.1}), Vector(1));
}

TEST(SynthTextures, GrainOnlyDarkensAndStaysWithinItsShare) {
  const Texture grainy{.first = Vector(0.8), .grain = 0.3};
  Random random(5);
  double least = 1;
  double most = 0;
  for (int i = 0; i < 2000; ++i) {
    const double value = colour_at(grainy, {random.uniform(-2, 2), random.uniform(-2, 2)}).x;
    least = std::min(least, value);
    most = std::max(most, value);
  }
  EXPECT_GE(least, 0.8 * 0.7);
  EXPECT_LE(most, 0.8);
  EXPECT_GT(most - least, 0.1);
}

TEST(SynthTextures, PatchesNeverRepeatAndFollowTheRestPoint) {
  Texture patches{Pattern::patches, Vector(0.1), Vector(0.9), Vec2<double>(20)};
  patches.grain = 0;
  Random random(5);
  int repeated = 0;
  int near = 0;
  for (int i = 0; i < 1000; ++i) {
    const Vector p = random_place(random, 1);
    const Vector colour = colour_at(patches, {0, 0}, p);
    EXPECT_EQ(colour, colour_at(patches, {7, 3}, p)) << "uv plays no part";
    for (int axis = 0; axis < 3; ++axis) EXPECT_TRUE(colour[axis] >= 0.1 && colour[axis] <= 0.9);
    Vector moved = p;
    moved[i % 3] += random.below(2) == 0 ? 0.5 : -1.0;  // whole periods of the lattice
    repeated += colour == colour_at(patches, {0, 0}, moved) ? 1 : 0;
    near += colour == colour_at(patches, {0, 0}, p + 0.002 * random_direction(random)) ? 1 : 0;
  }
  EXPECT_EQ(repeated, 0);
  EXPECT_GT(near, 850) << "patches are whole, not noise";
  EXPECT_LT(near, 1000);
}

TEST(SynthPoses, RotationTurnsRightHanded) {
  const Mat3<double> quarter = rotation_about({0, 0, 1}, std::numbers::pi / 2);
  EXPECT_NEAR(length(quarter * Vector(1, 0, 0) - Vector(0, 1, 0)), 0, 1e-15);
  EXPECT_NEAR(glm::determinant(rotation_about(normalize(Vector(1, 2, 3)), 0.7)), 1, 1e-14);
}

class NamedScenes : public testing::TestWithParam<SynthScene> {};

TEST_P(NamedScenes, MoveSmoothlyAndRigidly) {
  const AnimatedScene scene = make_scene(GetParam());
  bool moves = false;
  for (int step = 0; step < 200; ++step) {
    const Stage now = scene.at(step / 200.0);
    const Stage next = scene.at((step + 1) / 200.0);
    for (size_t i = 0; i < now.bodies.size(); ++i) {
      const Pose& a = now.bodies[i].pose;
      const Pose& b = next.bodies[i].pose;
      EXPECT_NEAR(glm::determinant(a.world_from_body), 1, 1e-12);
      EXPECT_LT(length(b.position - a.position), 0.01) << "body " << i << " jumps at step " << step;
      const bool deforms = now.bodies[i].bounding_radius != next.bodies[i].bounding_radius;
      if (deforms) {
        EXPECT_LT(std::abs(next.bodies[i].bounding_radius - now.bodies[i].bounding_radius), 0.01)
            << "body " << i;
      }
      moves = moves || deforms || a.position != b.position;
    }
  }
  EXPECT_TRUE(moves);
}

// Radius of the ball around the body's centre that the body is sure to fill.
double core_radius(const Shape& shape) {
  if (const auto* sphere = std::get_if<Sphere>(&shape)) return sphere->radius;
  if (const auto* box = std::get_if<Box>(&shape))
    return std::min({box->half_size.x, box->half_size.y, box->half_size.z});
  return 0;
}

TEST_P(NamedScenes, BodiesKeepOutOfEachOtherAndInTheRoom) {
  const AnimatedScene scene = make_scene(GetParam());
  for (int step = 0; step <= 50; ++step) {
    const Stage stage = scene.at(step / 50.0);
    for (size_t i = 0; i < stage.bodies.size(); ++i) {
      const double core = core_radius(stage.bodies[i].shape);
      const Vector& p = stage.bodies[i].pose.position;
      if (core > 0) {
        EXPECT_GE(p.z, core - 1e-9) << "body " << i << " sinks into the floor";
      }
      for (size_t j = i + 1; core > 0 && j < stage.bodies.size(); ++j) {
        const double other = core_radius(stage.bodies[j].shape);
        const int object = stage.bodies[i].object;
        const bool is_same_object = object >= 0 && object == stage.bodies[j].object;
        if (other > 0 && !is_same_object) {
          EXPECT_GT(length(stage.bodies[j].pose.position - p), core + other) << i << " and " << j;
        }
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, NamedScenes,
                         testing::Values(SynthScene::balls, SynthScene::mirror, SynthScene::tumble,
                                         SynthScene::soft));

TEST(SynthSampler, EverySampleOfAPixelGetsAnotherPointAndTheyFillTheSquare) {
  constexpr uint32_t count = 64;
  for (const uint64_t key : {1ULL, 99ULL}) {
    int occupied[4][4] = {};
    for (uint32_t sample = 0; sample < count; ++sample) {
      Sampler sampler(key, sample, count);
      sampler.next();
      const Vec2<double> p = sampler.next();
      ASSERT_TRUE(p.x >= 0 && p.x < 1 && p.y >= 0 && p.y < 1);
      ++occupied[static_cast<int>(4 * p.x)][static_cast<int>(4 * p.y)];
    }
    for (const auto& row : occupied) {
      for (const int n : row)
        EXPECT_TRUE(n >= 2 && n <= 6) << n << " of 64 points in a sixteenth of the square";
    }
  }
}

TEST(SynthSampler, DiskPointsAreUniform) {
  double sum2 = 0;
  constexpr uint32_t count = 4096;
  for (uint32_t sample = 0; sample < count; ++sample) {
    Sampler sampler(5, sample, count);
    const Vec2<double> p = disk_point(sampler.next());
    sum2 += dot(p, p);
  }
  EXPECT_NEAR(sum2 / count, 0.5, 0.002) << "mean squared radius of a uniform unit disk";
}

}  // namespace
}  // namespace traceflow::synth
