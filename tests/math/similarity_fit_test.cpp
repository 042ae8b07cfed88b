#include "math/similarity_fit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "math/random_vector.h"
#include "math/rotation.h"

namespace traceflow {
namespace {

using Points = std::vector<Vec3<double>>;

Mat3<double> random_rotation(Random& random) {
  return rotation_from_quaternion(
      Vec4<double>(random.normal(), random.normal(), random.normal(), random.normal()));
}

Points random_points(int count, Random& random) {
  Points points(static_cast<size_t>(count));
  for (Vec3<double>& x : points) x = Vec3<double>(3, -1, 2) + random_vector(random);
  return points;
}

Points taken(const Points& points, const Similarity& by) {
  Points result(points.size());
  std::transform(points.begin(), points.end(), result.begin(), by);
  return result;
}

double error(const Points& from, const Points& to, const Similarity& by) {
  double sum = 0;
  for (size_t i = 0; i < from.size(); ++i) sum += dot(by(from[i]) - to[i], by(from[i]) - to[i]);
  return sum;
}

void expect_proper(const Mat3<double>& r) {
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) EXPECT_NEAR(dot(r[a], r[b]), a == b ? 1 : 0, 1e-12);
  }
  EXPECT_NEAR(determinant(r), 1, 1e-12);
}

TEST(SimilarityFit, recovers_the_similarity_that_moved_the_points) {
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const Similarity truth{random_rotation(random), std::exp(random.normal()), random_vector(random)};
    const Points from = random_points(3 + i % 8, random);
    const Similarity found = fit_similarity(from, taken(from, truth));
    EXPECT_NEAR(found.scale, truth.scale, 1e-11 * truth.scale);
    EXPECT_NEAR(rotation_angle_deg(found.rotation * transpose(truth.rotation)), 0, 1e-6);
    EXPECT_NEAR(length(found.shift - truth.shift), 0, 1e-8 * truth.scale);
  }
}

TEST(SimilarityFit, of_points_that_no_similarity_takes_there_is_better_than_its_neighbours) {
  Random random(2);
  for (int i = 0; i < 50; ++i) {
    const Points from = random_points(6, random), to = random_points(6, random);
    const Similarity found = fit_similarity(from, to);
    expect_proper(found.rotation);
    const double least = error(from, to, found);
    for (int k = 0; k < 10; ++k) {
      Similarity other = found;
      const Vec3<double> turn = 1e-3 * random_vector(random);
      other.rotation = rotation_from_quaternion(Vec4<double>(1, turn.x, turn.y, turn.z)) * found.rotation;
      other.scale += 1e-3 * random.normal();
      other.shift += 1e-3 * random_vector(random);
      EXPECT_GE(error(from, to, other), least);
    }
  }
}

TEST(SimilarityFit, of_mirrored_flat_or_few_points_turns_and_never_mirrors) {
  Random random(3);
  const Points solid = random_points(20, random);
  Points mirrored, flat, line;
  for (const Vec3<double>& x : solid) {
    mirrored.emplace_back(-x.x, x.y, x.z);
    flat.emplace_back(x.x, x.y, 0);
    line.push_back(x.x * Vec3<double>(1, 2, 3));
  }
  for (const Points& to : {mirrored, flat, line}) {
    for (const Points& from : {solid, flat, line}) expect_proper(fit_similarity(from, to).rotation);
  }
  // A flat set says all of a rotation, and a line what turns it.
  const Similarity truth{random_rotation(random), 1.5, {1, 2, 3}};
  EXPECT_NEAR(error(flat, taken(flat, truth), fit_similarity(flat, taken(flat, truth))), 0, 1e-20);
  EXPECT_NEAR(error(line, taken(line, truth), fit_similarity(line, taken(line, truth))), 0, 1e-20);
}

TEST(SimilarityFit, of_points_at_one_place_is_a_shift) {
  const Points from(5, Vec3<double>(1, 2, 3)), to(5, Vec3<double>(4, 4, 4));
  const Similarity found = fit_similarity(from, to);
  EXPECT_EQ(found.rotation, Mat3<double>(1));
  EXPECT_EQ(found.scale, 1);
  EXPECT_NEAR(length(found.shift - Vec3<double>(3, 2, 1)), 0, 1e-12);
}

TEST(RotationAngle, is_that_of_the_quaternion) {
  for (const double degrees : {0.0, 1e-7, 0.5, 90.0, 179.0, 180.0}) {
    const double half = degrees * std::numbers::pi / 360;
    const Vec3<double> axis = Vec3<double>(2, -1, 2) / 3.0;
    const auto r = rotation_from_quaternion(Vec4<double>(std::cos(half), std::sin(half) * axis.x,
                                                         std::sin(half) * axis.y, std::sin(half) * axis.z));
    EXPECT_NEAR(rotation_angle_deg(r), degrees, 1e-9);
  }
}

}  // namespace
}  // namespace traceflow
