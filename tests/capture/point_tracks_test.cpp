#include "capture/point_tracks.h"

#include <gtest/gtest.h>

#include <limits>

#include "capture/view_source.h"
#include "fake_capture.h"
#include "files/npy.h"

namespace traceflow {
namespace {

// Points of the world seen through a lens with distortion come back as the directions that a pinhole sees.
TEST(PointTracks, ALensIsStraightened) {
  ViewSource source;
  source.lens.width = 640;
  source.lens.height = 360;
  source.lens.focal = {500, 510};
  source.lens.centre = {310, 190};
  source.lens.radial = {-0.12, 0.03, 0};
  source.lens.tangential = {0.002, -0.001};
  constexpr int64_t count = 25;
  Tensor<float> stored({2, count, 3});
  const auto direction = [](int64_t n) {
    const int64_t row = n / 5, column = n % 5;
    return Vec2<double>(0.1 * static_cast<double>(column) - 0.2, 0.08 * static_cast<double>(row) - 0.16);
  };
  for (int64_t n = 0; n < count; ++n) {
    const Vec2<double> pixel = source.lens.pixel_from_ideal(direction(n));
    store3(&stored(1, n, 0), Vec3<double>(pixel.x / source.lens.width, pixel.y / source.lens.height, 1));
  }
  const PointTracks tracks = tracks_of_rows(stored, {{1, &source}, {-1, &source}, {0, &source}});
  ASSERT_EQ(tracks.direction.shape(), (Shape{3, count, 2}));
  for (int64_t n = 0; n < count; ++n) {
    EXPECT_EQ(tracks.seen(0, n), 1);
    EXPECT_EQ(tracks.seen(1, n), 0);  // it has no row
    EXPECT_EQ(tracks.seen(2, n), 0);  // its row says so
    for (int side = 0; side < 2; ++side) EXPECT_NEAR(tracks.direction(0, n, side), direction(n)[side], 1e-5);
  }
}

TEST(PointTracks, WhatLiesOutsideOrIsNotFiniteIsNotSeen) {
  ViewSource source;
  source.lens.width = source.lens.height = 100;
  source.lens.focal = {100, 100};
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  Tensor<float> stored({1, 5, 3});
  const float points[] = {0.5F, 0.5F, 1, -0.01F, 0.5F, 1, 0.5F, 1.01F, 1, nan, 0.5F, 1, 0.5F, 0.5F, nan};
  std::copy(std::begin(points), std::end(points), stored.data());
  const PointTracks tracks = tracks_of_rows(stored, {{0, &source}});
  for (int64_t n = 0; n < 5; ++n) EXPECT_EQ(tracks.seen(0, n), n == 0 ? 1 : 0) << n;
}

// Row by row they belong to the training views, or to all.
TEST(PointTracks, RowsBelongToTheListedViews) {
  const NerfDsCapture fake;
  fake.save();
  for (const int64_t rows : {4, 8}) {
    Tensor<float> stored({rows, 1, 3});
    for (int64_t row = 0; row < rows; ++row)
      store3(&stored(row, 0, 0), Vec3<double>(static_cast<double>(row) / 10, 0.5, 1));
    write_npy(fake.path() / "tracks.npy", stored);
    const Capture capture = load_capture(fake.path(), {});
    ASSERT_EQ(capture.tracks.seen.shape(), (Shape{4, 1}));
    for (int64_t view = 0; view < 4; ++view) {
      const double share = static_cast<double>(rows == 4 ? view : 2 * view) / 10;
      EXPECT_NEAR(capture.tracks.direction(view, 0, 0), (12 * share - 6) / 10, 1e-5);
    }
  }
}

}  // namespace
}  // namespace traceflow
