#include "train/initial_observations.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "math/rotation.h"
#include "train/initialise.h"

namespace traceflow {
namespace {

constexpr Vec3<float> red{0.9F, 0.1F, 0.1F};
constexpr Vec3<float> blue{0.1F, 0.2F, 0.8F};

// A slab in front of a wall, seen by one camera that looks along z: the slab red and in the mask, the wall
// blue.
class SlabBeforeAWall : public ::testing::Test {
 protected:
  static constexpr int side = 96;
  static constexpr float slab_half = 0.4F, slab_front = 2, slab_back = 2.3F, wall_half = 1.2F, wall_z = 4;

  SlabBeforeAWall() {
    for (const float z : {slab_front, slab_back}) add_square(slab_half, 0.05F, z);
    add_square(wall_half, 0.1F, wall_z);
    Tensor<float> positions({static_cast<int64_t>(points_.size()), 3});
    for (size_t i = 0; i < points_.size(); ++i) store3(positions.row(static_cast<int64_t>(i)), points_[i]);
    Random random(1);
    surfels_ = surfels_at_points(positions, InitialOptions{}, random);

    Photograph photograph;
    photograph.camera.width = photograph.camera.height = side;
    photograph.camera.focal_x = photograph.camera.focal_y = side;
    photograph.camera.centre_x = photograph.camera.centre_y = side / 2.0F;
    auto images = std::make_shared<ViewImages>();
    images->colour.reset({side, side, 3});
    images->mask.reset({side, side});
    for (int row = 0; row < side; ++row) {
      for (int column = 0; column < side; ++column) {
        const bool slab = within(column) && within(row);
        images->mask(row, column) = slab;
        store3(images->colour.data() + 3 * (row * side + column), slab ? red : blue);
      }
    }
    photograph.images = images;
    photographs_ = {photograph};
  }

  // Whether a pixel's row or column shows the slab.
  static bool within(int pixel) {
    const float x = (static_cast<float>(pixel) + 0.5F - side / 2.0F) / side * slab_front;
    return std::abs(x) <= slab_half + 0.02F;
  }
  void add_square(float half, float spacing, float z) {
    for (float x = -half; x <= half + 1e-4F; x += spacing) {
      for (float y = -half; y <= half + 1e-4F; y += spacing) points_.emplace_back(x, y, z);
    }
  }

  std::vector<Vec3<float>> points_;
  Surfels surfels_;
  std::vector<Photograph> photographs_;
};

TEST_F(SlabBeforeAWall, EveryPointIsLabelledByWhatItBelongsTo) {
  const InitialObservations s = observe(surfels_, photographs_);
  for (size_t i = 0; i < points_.size(); ++i) {
    const bool wall = points_[i].z == wall_z;
    ASSERT_TRUE(s.any[i]);
    // The slab's back and the wall behind the slab are not seen; the one is the slab, the other is not.
    EXPECT_EQ(s.outside[i] > 0, wall) << points_[i].x << " " << points_[i].y << " " << points_[i].z;
    EXPECT_NEAR(s.colour(static_cast<int64_t>(i), 0), wall ? blue.x : red.x, 1e-6F);
  }
}

// Beside each other on a plane seen at a slant, points do not hide each other: each has its own colour.
TEST_F(SlabBeforeAWall, ASlantedPlaneDoesNotHideItself) {
  Tensor<float> floor({24 * 20, 3});
  for (int64_t i = 0; i < floor.dim(0); ++i) {
    const int64_t column = i % 20;
    const int64_t row = i / 20;
    store3(floor.row(i), Vec3<float>(-0.5F, 0.5F, 1.2F) +
                             0.05F * Vec3<float>(static_cast<float>(column), 0, static_cast<float>(row)));
  }
  Random random(1);
  const Surfels surfels = surfels_at_points(floor, InitialOptions{}, random);
  auto images = std::make_shared<ViewImages>();
  images->colour.reset({side, side, 3});
  for (int64_t i = 0; i < images->colour.size(); ++i) {
    images->colour[i] = static_cast<float>(i) / static_cast<float>(images->colour.size());
  }
  Photograph photograph = photographs_.front();
  photograph.images = images;
  const InitialObservations s = observe(surfels, {&photograph, 1});
  for (int64_t i = 0; i < surfels.count(); ++i) {
    const Vec2<float> at = photograph.camera.project(load3<float>(floor.row(i)));
    if (!(at.x >= 0 && at.x < side && at.y < side)) continue;
    const int64_t pixel = int64_t{static_cast<int>(at.y)} * side + static_cast<int>(at.x);
    EXPECT_EQ(s.colour(i, 0), images->colour[3 * pixel]) << i;
    EXPECT_EQ(s.outside[static_cast<size_t>(i)], 0);  // a photograph without a mask does not tell
  }
}

TEST_F(SlabBeforeAWall, WithoutPhotographsNothingIsKnown) {
  const InitialObservations s = observe(surfels_, {});
  EXPECT_EQ(s.any, std::vector<uint8_t>(points_.size(), 0));
}

// Against the planes of each view's pyramid, a tenth of the image wider all around, of which nothing is
// projected.
TEST(PointsInView, AreThoseInsideSomePyramid) {
  constexpr float near_plane = 0.3F;
  Random random(5);
  std::vector<View> views(3);
  for (View& view : views) {
    Camera<float>& camera = view.camera;
    camera.width = 40;
    camera.height = 24;
    camera.focal_x = 30;
    camera.focal_y = 35;
    camera.centre_x = 17;
    camera.centre_y = 13;
    camera.position = {static_cast<float>(random.normal()), static_cast<float>(random.normal()), 0};
    camera.camera_from_world = rotation_from_quaternion(normalize(
        Vec4<float>(1, static_cast<float>(random.normal()), static_cast<float>(random.normal()), 0.2F)));
  }
  const auto lies_inside = [&](const Vec3<float>& point, const Camera<float>& camera) {
    const Vec3<float> x = camera.point_in_camera(point);
    const float left = -4, top = -4;
    const float right = static_cast<float>(camera.width) + 4, bottom = static_cast<float>(camera.height) + 4;
    const std::array<Vec3<float>, 4> corners{
        camera.ray_in_camera(left, top), camera.ray_in_camera(right, top),
        camera.ray_in_camera(right, bottom), camera.ray_in_camera(left, bottom)};
    bool inside = x.z > near_plane;
    for (size_t k = 0; k < 4; ++k) inside &= dot(cross(corners[k], corners[(k + 1) % 4]), x) >= 0;
    return inside;
  };
  Tensor<float> points({3000, 3});
  std::vector<float> expected;
  for (int64_t i = 0; i < points.dim(0); ++i) {
    const Vec3<float> point(static_cast<float>(3 * random.normal()), static_cast<float>(3 * random.normal()),
                            static_cast<float>(3 * random.normal()));
    store3(points.row(i), point);
    if (std::any_of(views.begin(), views.end(), [&](const View& v) { return lies_inside(point, v.camera); }))
      expected.insert(expected.end(), {point.x, point.y, point.z});
  }
  const Tensor<float> seen = points_in_view(points, views, near_plane);
  ASSERT_GT(expected.size(), 300U);
  ASSERT_LT(expected.size(), 6000U);
  EXPECT_EQ(std::vector<float>(seen.values().begin(), seen.values().end()), expected);
  EXPECT_EQ(points_in_view(points, {}, near_plane).dim(0), 0);
  EXPECT_EQ(points_in_view(Tensor<float>({0, 3}), views, near_plane).dim(0), 0);
}

}  // namespace
}  // namespace traceflow
