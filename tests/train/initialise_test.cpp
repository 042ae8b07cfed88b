#include "train/initialise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>

#include "base/parallel.h"
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
  EXPECT_FALSE(s.has_roughness()) << "mirrors are perfect";
}

TEST(Initialise, OnlyWhatMirrorsHasARoughness) {
  TrainOptions options = small_run(1);
  options.initial.roughness = 0.2F;
  options.initial.environment_points = 500;
  Random random(1);
  const Scene scene = initial_scene(load_capture(capture_folder(), {}), options, random).scene;
  ASSERT_EQ(scene.main.roughness_logit.size(), scene.main.count());
  for (const float logit : scene.main.roughness_logit.values())
    EXPECT_NEAR(0.25F / (1 + std::exp(-logit)), 0.2F, 1e-6F);
  ASSERT_GT(scene.environment.count(), 0);
  EXPECT_FALSE(scene.environment.has_roughness());
}

TEST(Initialise, CoincidentAndSinglePointsStayFinite) {
  Random random(1);
  for (const int64_t count : {1, 2, 40}) {
    const Surfels s = surfels_at_points(Tensor<float>({count, 3}), InitialOptions{}, random);
    s.for_each([](const std::string& name, const Tensor<float>& t) {
      for (const float v : t.values()) ASSERT_TRUE(std::isfinite(v)) << name;
    });
  }
}

// No photograph then asks for more samples than it was trained with.
TEST(Initialise, TheSceneKnowsTheSmallestFocalLength) {
  Capture capture = load_capture(capture_folder(), {});
  capture.train[1].camera.focal_y *= 0.5F;
  Random random(1);
  const Scene scene = initial_scene(capture, small_run(1), random).scene;
  EXPECT_EQ(scene.focal, capture.train[1].camera.focal_y);
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
    const Scene scene = initial_scene(load_capture(folder / "capture", {}), options, random).scene;
    std::set<int> percent;
    for (const float logit : scene.main.tint_logit.values())
      percent.insert(static_cast<int>(std::lround(100 / (1 + std::exp(-logit)))));
    return percent;
  };
  EXPECT_EQ(tints(), (std::set<int>{1, 80}));
  fs::rename(folder / "capture/mask", folder / "capture/motion_mask");
  EXPECT_EQ(tints(), std::set<int>{20});
}

// Points behind every camera, and farther out than all others.
Tensor<float> unseen_points(const Capture& capture, int64_t count) {
  const Camera<float>& camera = capture.train.front().camera;
  Tensor<float> points({count, 3});
  for (int64_t i = 0; i < count; ++i) {
    const auto step = static_cast<float>(i);
    const Vec3<float> behind(0.01F * step, 0.02F * step, -20 - 0.03F * step);
    store3(points.row(i), camera.position + behind * camera.camera_from_world);
    for (const View& view : capture.train) EXPECT_FALSE(view.camera.sees(load3<float>(points.row(i))));
  }
  return points;
}

std::set<std::array<float, 3>> places(const Tensor<float>& points) {
  std::set<std::array<float, 3>> result;
  for (int64_t i = 0; i < points.dim(0); ++i) result.insert({points(i, 0), points(i, 1), points(i, 2)});
  return result;
}

TEST(Initialise, PointsThatNoViewSeesStartNoMainSurfelsButMayBeSurroundings) {
  TrainOptions options = small_run(1);
  options.initial.environment_points = 100000;
  options.environment_density.max_surfels = 100000;
  Capture capture = load_capture(capture_folder(), {});
  const Tensor<float> own = capture.points;
  const Tensor<float> unseen = unseen_points(capture, 50);
  Tensor<float> all({own.dim(0) + 50, 3});
  std::copy_n(unseen.data(), unseen.size(), all.data());
  std::copy_n(own.data(), own.size(), all.row(50));
  capture.points = all;
  Random random(1);
  const InitialScene made = initial_scene(capture, options, random);

  std::set<std::array<float, 3>> expected;
  for (const auto& x : places(own)) {
    const Vec3<float> point(x[0], x[1], x[2]);
    // Beside the image too, by a tenth of its longer side.
    if (std::any_of(capture.train.begin(), capture.train.end(), [&](const View& view) {
          return view.camera.sees(point, 0.01F, 0.1F * static_cast<float>(view.camera.width));
        }))
      expected.insert(x);
  }
  EXPECT_EQ(places(made.scene.main.position), expected);
  EXPECT_EQ(made.points, all.dim(0));
  EXPECT_EQ(made.points_in_view, made.scene.main.count());
  const auto surroundings = places(made.scene.environment.position);
  int64_t taken = 0;
  for (const auto& x : places(unseen)) taken += surroundings.contains(x) ? 1 : 0;
  EXPECT_EQ(taken, 50);
}

TEST(Initialise, WhereNoViewSeesAnyPointSurfelsStartAsWithoutPoints) {
  const TrainOptions options = small_run(1);
  Capture capture = load_capture(capture_folder(), {});
  capture.points = unseen_points(capture, 50);
  Random random(1), same(1);
  const InitialScene made = initial_scene(capture, options, random);
  EXPECT_EQ(made.points, 50);
  EXPECT_EQ(made.points_in_view, 0);
  capture.points = {};
  EXPECT_EQ(scene_bytes(made.scene), scene_bytes(initial_scene(capture, options, same).scene));
}

TEST(Initialise, TheSameSeedGivesTheSameSceneAtAnyNumberOfThreads) {
  Capture capture = load_capture(capture_folder(), {});
  std::set<std::string> scenes;
  for (const int threads : {1, 3}) {
    set_threads(threads);
    Random random(1);
    scenes.insert(scene_bytes(initial_scene(capture, small_run(1), random).scene));
  }
  set_threads(0);
  EXPECT_EQ(scenes.size(), 1U);
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
