#include "viz/track_picture.h"

#include <gtest/gtest.h>

#include "viz/layers.h"
#include "viz/moving_board.h"

namespace traceflow::viz {
namespace {

double farthest(const SeenTrack& track, const MovingBoard& f, int64_t i, const std::vector<double>& times) {
  double worst = 0;
  for (size_t v = 0; v < times.size(); ++v) {
    const Vec2<double> expected = MovingBoard::pixel_of(f.place_at(i, times[v]), f.request.camera);
    worst = std::max(worst, length(track.place[v] - expected));
  }
  return worst;
}

TEST(TrackPicture, PlacesAreTheProjectedPosesOfTheBody) {
  MovingBoard f;
  const TrackFollower follower = f.follower();
  for (const Vec3<float>& eye : {Vec3<float>(0, 0, -3), Vec3<float>(0.4F, -0.2F, -2.5F)}) {
    f.request.camera.position = eye;
    const std::vector<SeenTrack> seen = seen_tracks(f.frame_at(0.75F), follower.at(f.scene, 0.75F));
    ASSERT_EQ(seen.size(), static_cast<size_t>(MovingBoard::points)) << "the present camera sees all";
    for (int64_t i = 0; i < MovingBoard::points; ++i) {
      const SeenTrack& track = seen[static_cast<size_t>(i)];
      ASSERT_EQ(track.place.size(), 4U);
      EXPECT_LT(farthest(track, f, i, {0.75, 0.5, 0.25, 0}), 1e-4) << "point " << i;
    }
  }
}

// A surfel before the left half of the picture, in the place of one of the wall's.
void stand_before(MovingBoard& f) {
  Surfels& s = f.scene.main;
  const int64_t wall = MovingBoard::points;
  store3(s.position.row(wall), Vec3<float>(-0.6F, 0, -1));
  s.log_scale(wall, 0) = std::log(0.5F);
  s.log_scale(wall, 1) = std::log(3.0F);
  s.opacity_logit[wall] = 12;
}

TEST(TrackPicture, WhatIsHiddenNowHasNoPath) {
  MovingBoard f;
  const TrackFollower follower = f.follower();
  const Tracks tracks = follower.at(f.scene, 0.5F);
  ASSERT_EQ(seen_tracks(f.frame_at(0.5F), tracks).size(), static_cast<size_t>(MovingBoard::points));
  stand_before(f);
  const Frame& frame = f.frame_at(0.5F);
  int64_t hidden = 0;
  for (int64_t i = 0; i < MovingBoard::points; ++i) {
    const Vec2<double> at = MovingBoard::pixel_of(f.place_at(i, 0.5), f.request.camera);
    const float depth = frame.raster.median_depth(static_cast<int64_t>(at.y), static_cast<int64_t>(at.x));
    hidden += depth < 2.5F ? 1 : 0;
  }
  ASSERT_GT(hidden, 4);
  ASSERT_LT(hidden, MovingBoard::points - 4);
  EXPECT_EQ(static_cast<int64_t>(seen_tracks(frame, tracks).size()), MovingBoard::points - hidden);
}

TEST(TrackPicture, WhatIsOutsideOrBehindHasNoPath) {
  MovingBoard f;
  const Tracks tracks = f.follower().at(f.scene, 1);
  f.request.camera.position = {50, 0, -3};
  EXPECT_TRUE(seen_tracks(f.frame_at(1), tracks).empty()) << "beside the picture";
  f.request.camera.position = {0, 0, 1};
  EXPECT_TRUE(seen_tracks(f.frame_at(1), tracks).empty()) << "behind the camera";
  // From where the board passed: what of a path lies behind the camera is cut off.
  f.request.camera.position = {0.2F, -0.1F, 0.2F};
  for (const SeenTrack& track : seen_tracks(f.frame_at(1), tracks)) {
    EXPECT_LE(track.place.size(), 2U);
    for (const Vec2<double>& place : track.place) EXPECT_TRUE(std::isfinite(place.x + place.y));
  }
}

// One point that comes from the left along a row of pixels.
struct OnePath {
  Frame frame;
  Tracks tracks;

  OnePath() {
    frame.camera.width = 60;
    frame.camera.height = 20;
    frame.camera.focal_x = frame.camera.focal_y = 10;
    frame.camera.position = {0, 0, -1};
    frame.colour.reset({20, 60, 3});
    frame.colour.fill(0.5F);
    frame.raster.median_depth.reset({20, 60});
    tracks.age = {0, 1, 2};
    tracks.oldest = 4;
    tracks.hue = {0};
    tracks.position.reset({3, 1, 3});
    for (int64_t v = 0; v < 3; ++v) {
      // Pixel centres: 50.5, 30.5 and 10.5 in row 10.5.
      store3(tracks.position.row(v), Vec3<float>(5.05F - 2 * static_cast<float>(v), 1.05F, 0));
    }
  }
};

TEST(TrackPicture, DrawsAPathThatFadesAndADot) {
  const OnePath f;
  const Tensor<float> picture = track_picture(f.frame, f.tracks);
  ASSERT_EQ(picture.shape(), f.frame.colour.shape());
  const Vec3<float> red = rainbow_colour(0);
  EXPECT_EQ(red, Vec3<float>(1, 0, 0));
  // A line as wide as a pixel covers those whose centres it goes through; its strength falls from 1 by a
  // quarter in 20 pixels.
  for (int64_t x = 10; x <= 47; ++x) {
    const auto strength = static_cast<float>(1 - 0.25 * (50 - static_cast<double>(x)) / 20);
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(picture(10, x, c), std::lerp(0.5F, red[c], strength), 1e-5F) << x << " " << c;
  }
  EXPECT_EQ(load3<float>(&picture(10, 50, 0)), red) << "the dot";
  EXPECT_GT(picture(9, 50, 0), 0.6F) << "it is wider than the line";
  for (const auto& [y, x] : {std::pair{8, 30}, {12, 30}, {10, 9}, {10, 53}, {0, 0}, {19, 59}})
    EXPECT_EQ(picture(y, x, 0), 0.5F) << y << " " << x;
}

TEST(TrackPicture, DrawsAcrossTheBorderAndAnyDirection) {
  OnePath f;
  f.tracks.age = {0, 1};
  f.tracks.position.reset({2, 1, 3});
  store3(f.tracks.position.row(0), Vec3<float>(3.05F, 1.05F, 0));
  const Vec3<float> from(3.05F, 1.05F, 0);
  for (const Vec3<float>& way : {Vec3<float>(0, -90, 0), Vec3<float>(1e6F, 0, 0), Vec3<float>(-7e6F, 5e6F, 0),
                                 Vec3<float>(2, 0.5F, 0), Vec3<float>(0, 0, 0)}) {
    store3(f.tracks.position.row(1), from + way);
    const Tensor<float> picture = track_picture(f.frame, f.tracks);
    // Against the distance of every pixel from the segment, out of the dot's reach.
    const Vec2<double> a(30.5, 10.5), b = a + 10.0 * Vec2<double>(way.x, way.y), d = b - a;
    for (int64_t y = 0; y < 20; ++y) {
      for (int64_t x = 0; x < 60; ++x) {
        const Vec2<double> p(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5);
        if (length(p - a) < 2) continue;
        const double t = dot(d, d) > 0 ? std::clamp(dot(p - a, d) / dot(d, d), 0.0, 1.0) : 0;
        const double strength = std::clamp(1 - length(p - (a + t * d)), 0.0, 1.0) * (1 - t / 4);
        ASSERT_NEAR(picture(y, x, 0), 0.5 + 0.5 * strength, 1e-3) << x << " " << y << " to " << b.x;
      }
    }
  }
}

TEST(TrackPicture, ColoursGoFromRedToViolet) {
  EXPECT_EQ(rainbow_colour(0.2F), Vec3<float>(1, 1, 0));
  EXPECT_EQ(rainbow_colour(0.4F), Vec3<float>(0, 1, 0));
  EXPECT_EQ(rainbow_colour(1), Vec3<float>(1, 0, 1));
  EXPECT_EQ(rainbow_colour(7), rainbow_colour(1));
}

TEST(TrackPicture, IsALayerOfAFrame) {
  MovingBoard f;
  const Frame& frame = f.frame_at(0.75F);
  const Tracks tracks = f.follower().at(f.scene, 0.75F);
  const auto differing = [&](const Tensor<float>& picture) {
    int64_t count = 0;
    for (int64_t i = 0; i < picture.size(); ++i) count += picture[i] != frame.colour[i] ? 1 : 0;
    return count;
  };
  EXPECT_EQ(differing(layer_values(frame, Layer::tracks, 1)), 0) << "a scene without paths";
  const Tensor<float> picture = layer_values(frame, Layer::tracks, 1, tracks);
  EXPECT_GT(differing(picture), 0);
  // Along the way of a corner of the board, by hand, the picture is no longer the render.
  for (double t = 0.75; t > 0.3; t -= 0.05) {
    const Vec2<double> at = MovingBoard::pixel_of(f.place_at(4, t), f.request.camera);
    const auto x = static_cast<int64_t>(at.x), y = static_cast<int64_t>(at.y);
    EXPECT_NE(load3<float>(&picture(y, x, 0)), load3<float>(&frame.colour(y, x, 0))) << t;
  }
}

}  // namespace
}  // namespace traceflow::viz
