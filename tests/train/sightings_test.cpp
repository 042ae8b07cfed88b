#include "train/sightings.h"

#include <gtest/gtest.h>

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
  const Sightings s = look_at(surfels_, photographs_);
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
  const Sightings s = look_at(surfels, {&photograph, 1});
  for (int64_t i = 0; i < surfels.count(); ++i) {
    const Vec2<float> at = photograph.camera.project(load3<float>(floor.row(i)));
    if (!(at.x >= 0 && at.x < side && at.y < side)) continue;
    const int64_t pixel = int64_t{static_cast<int>(at.y)} * side + static_cast<int>(at.x);
    EXPECT_EQ(s.colour(i, 0), images->colour[3 * pixel]) << i;
    EXPECT_EQ(s.outside[static_cast<size_t>(i)], 1);  // a photograph without a mask shows no object
  }
}

TEST_F(SlabBeforeAWall, WithoutPhotographsNothingIsKnown) {
  const Sightings s = look_at(surfels_, {});
  EXPECT_EQ(s.any, std::vector<uint8_t>(points_.size(), 0));
}

}  // namespace
}  // namespace traceflow
