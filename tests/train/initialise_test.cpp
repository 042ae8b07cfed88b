#include "train/initialise.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <set>

#include "math/rotation.h"
#include "scene/neighbours.h"
#include "small_run.h"
#include "support/temp_folder.h"

namespace traceflow {
namespace {

// A square grid of points in a tilted plane.
struct Plane {
  Vec3<float> normal = normalize(Vec3<float>(0.3F, -0.5F, 0.8F));
  float spacing = 0.1F;
  Tensor<float> points;

  explicit Plane(int side) : points({int64_t{side} * side, 3}) {
    const Vec3<float> u = normalize(cross(normal, Vec3<float>(1, 0, 0)));
    const Vec3<float> v = cross(normal, u);
    for (int64_t i = 0; i < points.dim(0); ++i) {
      const int64_t row = i / side;
      const int64_t column = i % side;
      store3(points.row(i), spacing * (static_cast<float>(column) * u + static_cast<float>(row) * v));
    }
  }
};

TEST(Initialise, ScaleIsTheRootMeanSquareDistanceToThreeNeighbours) {
  const Plane plane(9);
  Random random(1);
  const Surfels s = surfels_at_points(plane.points, InitialOptions{}, random);
  // An inner point has its four neighbours at one spacing.
  EXPECT_NEAR(std::exp(s.log_scale(4 * 9 + 4, 0)), plane.spacing, 1e-5F);
  // A corner has two at one spacing and one across the diagonal.
  EXPECT_NEAR(std::exp(s.log_scale(0, 1)), plane.spacing * std::sqrt((1 + 1 + 2) / 3.0F), 1e-5F);
}

TEST(Initialise, NormalsFollowTheNeighbours) {
  const Plane plane(9);
  Random random(1);
  const Surfels s = surfels_at_points(plane.points, InitialOptions{}, random);
  for (int64_t i = 0; i < s.count(); ++i) {
    const Vec3<float> n = rotation_from_quaternion(load4<float>(s.rotation.row(i)))[2];
    ASSERT_NEAR(std::abs(dot(n, plane.normal)), 1, 1e-4F) << i;
  }
}

TEST(Initialise, OpacityAndTintAreAsTheOptionsSay) {
  const Plane plane(3);
  InitialOptions options;
  options.opacity = 0.25F;
  options.tint = 0.002F;
  Random random(1);
  const Surfels s = surfels_at_points(plane.points, options, random);
  EXPECT_NEAR(1 / (1 + std::exp(-s.opacity_logit[4])), 0.25F, 1e-6F);
  EXPECT_NEAR(1 / (1 + std::exp(-s.tint_logit[4])), 0.002F, 1e-6F);
}

TEST(Initialise, CoincidentAndSinglePointsStayFinite) {
  Random random(1);
  for (const int64_t count : {1, 2, 40}) {
    const Surfels s = surfels_at_points(Tensor<float>({count, 3}), InitialOptions{}, random);
    s.for_each([](const char* name, const Tensor<float>& t) {
      for (const float v : t.values()) ASSERT_TRUE(std::isfinite(v)) << name;
    });
  }
}

TEST(Initialise, MasksOfTheObjectSayWhatMirrorsAndEstimatedOnesDoNot) {
  const TempFolder folder;
  fs::copy(capture_folder(), folder / "capture", fs::copy_options::recursive);
  TrainOptions options = small_run(1);
  options.initial.tint = 0.2F;
  options.initial.tint_in_mask = 0.8F;
  options.initial.tint_outside_mask = 0.01F;
  const auto tints = [&] {
    Random random(1);
    const Scene scene = initial_scene(load_capture(folder / "capture", {}), options, random);
    std::set<int> percent;
    for (const float logit : scene.main.tint_logit.values())
      percent.insert(static_cast<int>(std::lround(100 / (1 + std::exp(-logit)))));
    return percent;
  };
  EXPECT_EQ(tints(), (std::set<int>{1, 80}));
  fs::rename(folder / "capture/mask", folder / "capture/motion_mask");
  EXPECT_EQ(tints(), std::set<int>{20});
}

TEST(Initialise, TheEnvironmentFillsItsBoxEvenly) {
  const Plane plane(9);
  View view;
  view.camera.position = {0, 0, -2};
  InitialOptions options;
  options.environment_cells = 4;
  options.environment_per_cell = 3;
  options.environment_box = 2;
  Random random(1);
  const Surfels s = surfels_around(plane.points, {view}, 1000, options, random);
  ASSERT_EQ(s.count(), 4 * 4 * 4 * 3);
  EXPECT_FALSE(s.has_tint());
  float low = 1e9F;
  float high = -1e9F;
  for (int64_t i = 0; i < s.count(); ++i) {
    low = std::min(low, s.position(i, 2));
    high = std::max(high, s.position(i, 2));
  }
  EXPECT_LT(low, -2);
  EXPECT_GT(high, 0.2F);
}

TEST(Initialise, AnEnvironmentWithALimitIsSpreadOverItsBox) {
  const Plane plane(9);
  View view;
  view.camera.position = {0, 0, -2};
  InitialOptions options;
  options.environment_cells = 4;
  options.environment_per_cell = 1000000000;
  Random random(1);
  const Surfels s = surfels_around(plane.points, {view}, 64, options, random);
  ASSERT_EQ(s.count(), 64);
  // As many cells as surfels: one in each.
  Vec3<float> low(1e9F), high(-1e9F);
  for (int64_t i = 0; i < s.count(); ++i) {
    low = glm::min(low, load3<float>(s.position.row(i)));
    high = glm::max(high, load3<float>(s.position.row(i)));
  }
  std::set<std::array<int, 3>> cells;
  for (int64_t i = 0; i < s.count(); ++i) {
    // The outermost surfels are within a cell of the box's sides.
    const Vec3<float> place = (load3<float>(s.position.row(i)) - low) / (high - low) * 3.999F;
    cells.insert({static_cast<int>(place.x), static_cast<int>(place.y), static_cast<int>(place.z)});
  }
  EXPECT_GT(cells.size(), 40U);
}

TEST(Neighbours, AgreeWithABruteForceSearch) {
  Random random(3);
  Tensor<float> points({200, 3});
  for (float& v : points.values()) v = static_cast<float>(random.normal());
  const Neighbours found = nearest_neighbours(points, 4);
  for (int64_t i = 0; i < 200; ++i) {
    std::vector<float> distances;
    for (int64_t j = 0; j < 200; ++j) {
      const Vec3<float> d = load3<float>(points.row(i)) - load3<float>(points.row(j));
      if (j != i) distances.push_back(dot(d, d));
    }
    std::sort(distances.begin(), distances.end());
    for (int64_t k = 0; k < 4; ++k)
      ASSERT_NEAR(found.distance2(i, k), distances[static_cast<size_t>(k)], 1e-5F);
  }
}

TEST(Neighbours, NearestOfAgreesWithABruteForceSearch) {
  Random random(5);
  Tensor<float> points({200, 3}), queries({50, 3});
  for (float& v : points.values()) v = static_cast<float>(random.uniform(-1, 1));
  for (float& v : queries.values()) v = static_cast<float>(random.uniform(-1, 1));
  const Tensor<int32_t> nearest = nearest_of(points, queries);
  for (int64_t i = 0; i < queries.dim(0); ++i) {
    const auto distance = [&](int64_t j) {
      return length(load3<float>(points.row(j)) - load3<float>(queries.row(i)));
    };
    int64_t best = 0;
    for (int64_t j = 1; j < points.dim(0); ++j) best = distance(j) < distance(best) ? j : best;
    EXPECT_EQ(nearest[i], best);
  }
}

TEST(HalfDiagonal, IsOfTheBoxAndForgivesStrays) {
  Random random(1);
  Tensor<float> points({2000, 3});
  for (int64_t i = 0; i < points.dim(0); ++i) {
    points(i, 0) = static_cast<float>(random.uniform(0, 2));
    points(i, 1) = static_cast<float>(random.uniform(0, 4));
    points(i, 2) = static_cast<float>(random.uniform(-2, 2));
  }
  EXPECT_NEAR(half_diagonal(points), 3, 0.06);
  points(7, 0) = points(9, 2) = 1e6F;
  EXPECT_NEAR(half_diagonal(points), 3, 0.06);
  EXPECT_EQ(half_diagonal({}), 1);
}

TEST(CloudRadius, HoldsNineTenthsAndForgivesStrays) {
  Tensor<float> points({101, 3});
  for (int64_t i = 0; i < 101; ++i) {
    points(i, 0) = 5 + 0.02F * static_cast<float>(i - 50);
    points(i, 1) = -3;
  }
  points(0, 2) = 1e6F;
  points(100, 1) = std::numeric_limits<float>::quiet_NaN();
  EXPECT_NEAR(cloud_radius(points), 0.9F, 0.03F);
  EXPECT_EQ(cloud_radius(Tensor<float>({0, 3})), 1);
}

}  // namespace
}  // namespace traceflow
