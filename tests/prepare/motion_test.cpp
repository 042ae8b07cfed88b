#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "base/random.h"
#include "math/rotation.h"
#include "prepare/motion/motion.h"
#include "prepare/motion/moving_mask.h"
#include "prepare/motion/track.h"
#include "prepare/motion/two_view.h"

namespace traceflow::prepare {
namespace {

// A smooth pattern of waves short and long, which repeats nowhere near.
double pattern(double x, double y) {
  return 128 + 25 * std::sin(0.043 * x + 0.019 * y + 4) + 20 * std::sin(0.061 * y - 0.027 * x + 5) +
         20 * std::sin(0.13 * x + 0.08 * y + 6) + 15 * std::sin(0.11 * y - 0.17 * x + 1) +
         15 * std::sin(0.31 * x + 0.11 * y) + 15 * std::sin(0.37 * y + 0.05 * x + 2) +
         10 * std::sin(0.49 * x - 0.39 * y + 3);
}

template <class F>
Tensor<float> painted(int64_t height, int64_t width, F&& f) {
  Tensor<float> picture({height, width});
  for (int64_t y = 0; y < height; ++y) {
    for (int64_t x = 0; x < width; ++x)
      picture(y, x) = static_cast<float>(f(static_cast<double>(x), static_cast<double>(y)));
  }
  return picture;
}

TEST(Track, FindsAShiftOfManyPixels) {
  const Vec2<double> shift(13.4, -7.7);
  const Pyramid a = make_pyramid(painted(96, 128, [](double x, double y) { return pattern(x, y); }));
  const Pyramid b =
      make_pyramid(painted(96, 128, [&](double x, double y) { return pattern(x - shift.x, y - shift.y); }));
  const std::vector<Track> tracks = track(a, b, find_corners(a, 8));
  EXPECT_GT(tracks.size(), 60U);
  int64_t exact = 0;
  for (const Track& t : tracks) exact += length(t.to - t.from - shift) < 0.1 ? 1 : 0;
  EXPECT_GT(static_cast<double>(exact), 0.95 * static_cast<double>(tracks.size()));
}

TEST(Track, FindsNothingWhereThereIsNothingToSee) {
  const Pyramid flat = make_pyramid(painted(64, 64, [](double, double) { return 90.0; }));
  EXPECT_TRUE(find_corners(flat, 8).empty());
  EXPECT_TRUE(track(flat, flat, {{30, 30}}).empty());
}

struct Cameras {
  PlacedCamera a, b;
  Cameras() {
    a.pixel_from_camera = b.pixel_from_camera = Mat3<double>(500, 0, 0, 0, 510, 0, 320, 180, 1);
    b.camera_from_world = rotation_from_quaternion(Vec4<double>(1, 0.02, -0.05, 0.01));
    b.position = {0.4, -0.1, 0.05};
  }
  static Vec2<double> see(const PlacedCamera& camera, const Vec3<double>& point) {
    const Vec3<double> p = camera.pixel_from_camera * (camera.camera_from_world * (point - camera.position));
    return {p.x / p.z, p.y / p.z};
  }
  Track track_of(const Vec3<double>& point) const { return {see(a, point), see(b, point), 0}; }
};

Vec3<double> point_in_room(Random& random) {
  return {random.uniform(-1.5, 1.5), random.uniform(-0.8, 0.8), random.uniform(2, 6)};
}

TEST(TwoView, TheLinesOfKnownCamerasHoldEveryPoint) {
  const Cameras cameras;
  const TwoView lines = epipolar_lines(cameras.a, cameras.b);
  Random random(1);
  for (int i = 0; i < 50; ++i) EXPECT_LT(lines.distance(cameras.track_of(point_in_room(random))), 1e-9);
}

TEST(TwoView, SampsonsDistanceIsThatFromTheLine) {
  const Cameras cameras;
  const TwoView lines = epipolar_lines(cameras.a, cameras.b);
  Random random(2);
  for (int i = 0; i < 20; ++i) {
    Track t = cameras.track_of(point_in_room(random));
    // Across the line in the second picture, by one pixel: both ends share the error.
    const Vec3<double> line = lines.matrix * Vec3<double>(t.from, 1);
    t.to += Vec2<double>(line) / length(Vec2<double>(line));
    EXPECT_NEAR(lines.distance(t), std::sqrt(0.5), 0.1);
  }
}

// The centres of a large pixel and of the small ones in it are at the same place.
TEST(TwoView, LargerPixelsSeeTheSame) {
  const double factor = 2.5;
  const auto larger = [&](const Vec2<double>& p) {
    return (p + Vec2<double>(0.5)) / factor - Vec2<double>(0.5);
  };
  const Cameras cameras;
  Cameras turning;
  turning.b.position = turning.a.position;
  std::vector<Track> turned(30);
  Random random(6);
  for (Track& t : turned) t = turning.track_of(point_in_room(random));
  const TwoView lines = in_larger_pixels(epipolar_lines(cameras.a, cameras.b), factor),
                plane = in_larger_pixels(fit_homography(turned), factor);
  for (int i = 0; i < 30; ++i) {
    Track t = cameras.track_of(point_in_room(random)), u = turned[static_cast<size_t>(i)];
    for (Track* track : {&t, &u}) *track = {larger(track->from), larger(track->to), 0};
    EXPECT_LT(lines.distance(t), 1e-9);
    EXPECT_LT(plane.distance(u), 1e-6);
  }
}

TEST(TwoView, FindsTheLinesAmongTracksThatMove) {
  const Cameras cameras;
  const TwoView truth = epipolar_lines(cameras.a, cameras.b);
  Random random(3);
  std::vector<Track> tracks;
  for (int i = 0; i < 300; ++i) {
    Track t = cameras.track_of(point_in_room(random));
    t.to += Vec2<double>(0.2 * random.normal(), 0.2 * random.normal());
    if (i % 3 == 0) t.to += Vec2<double>(random.uniform(-30, 30), 8 + random.uniform(0, 30));
    tracks.push_back(t);
  }
  const TwoView found = fit_two_view(tracks, 1, 0).value();
  EXPECT_EQ(found.kind, TwoView::Kind::fundamental);
  double worst = 0;
  Random fresh(4);
  for (int i = 0; i < 50; ++i) {
    const Track t = cameras.track_of(point_in_room(fresh));
    EXPECT_LT(truth.distance(t), 1e-9);
    worst = std::max(worst, found.distance(t));
  }
  EXPECT_LT(worst, 0.5);
}

// The first samples, which hardly a track obeys, must not end the search.
TEST(TwoView, FindsTheLinesWhereverTheSearchBegins) {
  const Cameras cameras;
  Random random(3);
  std::vector<Track> tracks;
  for (int i = 0; i < 300; ++i) {
    tracks.push_back(cameras.track_of(point_in_room(random)));
    if (i % 2 == 0) tracks.back().to += Vec2<double>(random.uniform(-400, 400), random.uniform(-400, 400));
  }
  for (uint64_t seed = 0; seed < 12; ++seed) {
    const TwoView found = fit_two_view(tracks, 1, seed).value();
    int obeying = 0;
    for (const Track& track : tracks) obeying += found.distance(track) < 0.5 ? 1 : 0;
    EXPECT_GE(obeying, 140) << seed;
  }
}

TEST(TwoView, FindsThePlaneOfACameraThatTurns) {
  Cameras cameras;
  cameras.b.position = cameras.a.position;
  Random random(5);
  std::vector<Track> tracks;
  for (int i = 0; i < 200; ++i) {
    Track t = cameras.track_of(point_in_room(random));
    if (i % 9 == 0) t.to += Vec2<double>(12, 3);
    tracks.push_back(t);
  }
  const TwoView found = fit_two_view(tracks, 1, 0).value();
  EXPECT_EQ(found.kind, TwoView::Kind::homography);
  for (size_t i = 0; i < tracks.size(); ++i)
    EXPECT_NEAR(found.distance(tracks[i]), i % 9 == 0 ? length(Vec2<double>(12, 3)) : 0, 0.1);
}

TEST(TwoView, TooFewTracksAndTracksOnOnePlaceTellNothing) {
  const Cameras cameras;
  Random random(6);
  std::vector<Track> tracks(12);
  for (Track& track : tracks) track = cameras.track_of(point_in_room(random));
  EXPECT_TRUE(fit_two_view(tracks, 1, 0));
  tracks.pop_back();
  EXPECT_FALSE(fit_two_view(tracks, 1, 0));
  EXPECT_FALSE(fit_two_view(std::vector<Track>(40, Track{{5, 5}, {6, 6}, 0}), 1, 0));
}

// Cameras on a walk past a wall at depth 4 with a column at depth 2, and a square that moves by itself in
// front of the wall.
struct Stage {
  static constexpr int64_t height = 144, width = 240, count = 5;
  static constexpr double focal = 200;

  static PlacedCamera camera(int64_t i) {
    PlacedCamera c;
    c.pixel_from_camera = Mat3<double>(focal, 0, 0, 0, focal, 0, width / 2.0, height / 2.0, 1);
    c.position = {0.06 * static_cast<double>(i), 0, 0};
    return c;
  }
  // Corner of the square in picture i.
  static Vec2<double> square(int64_t i) {
    return {90 + 2.0 * static_cast<double>(i), 50 + 5.0 * static_cast<double>(i)};
  }
  static constexpr double side = 44;
  static bool in_square(int64_t i, double x, double y) {
    const Vec2<double> corner = square(i);
    return x >= corner.x && y >= corner.y && x < corner.x + side && y < corner.y + side;
  }
  static Tensor<uint8_t> picture(int64_t i) {
    const double step = focal * 0.06 * static_cast<double>(i);
    const Tensor<float> grey = painted(height, width, [&](double x, double y) {
      if (in_square(i, x, y)) return pattern(300 + x - square(i).x, 700 + y - square(i).y);
      const double behind = x + step / 4, column = x + step / 2;
      return column > 180 && column < 230 ? pattern(900 + column, 40 + y) : pattern(behind, y);
    });
    Tensor<uint8_t> result({height, width, 1});
    for (int64_t k = 0; k < grey.size(); ++k)
      result[k] = static_cast<uint8_t>(std::clamp(std::lround(grey[k]), 0L, 255L));
    return result;
  }
};

// Intersection over union with the square.
double overlap(const Tensor<uint8_t>& mask, int64_t i) {
  int64_t both = 0, either = 0;
  for (int64_t y = 0; y < mask.dim(0); ++y) {
    for (int64_t x = 0; x < mask.dim(1); ++x) {
      const bool truth = Stage::in_square(i, static_cast<double>(x), static_cast<double>(y)),
                 found = mask(y, x) != 0;
      both += truth && found ? 1 : 0;
      either += truth || found ? 1 : 0;
    }
  }
  return static_cast<double>(both) / static_cast<double>(either);
}

TEST(MovingMask, IsWhereTheSquareMoves) {
  const std::atomic<bool> stop = false;
  for (const bool known : {false, true}) {
    const auto masks = moving_masks(
        Stage::count, Stage::picture,
        [known](int64_t i, int64_t j) -> std::optional<TwoView> {
          if (!known) return std::nullopt;
          return epipolar_lines(Stage::camera(i), Stage::camera(j));
        },
        stop);
    ASSERT_EQ(masks.size(), 5U);
    for (int64_t i = 0; i < Stage::count; ++i) {
      EXPECT_GT(overlap(masks[static_cast<size_t>(i)], i), 0.55)
          << "picture " << i << (known ? " with" : " without") << " known cameras";
    }
  }
}

// Stripes that repeat every 12 pixels, whose tracks ended at the next one, as those of a railway's sleepers
// may; and a square that moves by itself.
TEST(Motion, WhatRepeatsIsFollowedAgainAndWhatMovesStaysAsItIs) {
  const Vec2<double> way(9, 0), own(-4, 15);
  constexpr double period = 12;
  const auto in_stripes = [](double x, double y) { return x > 40 && x < 150 && y > 30 && y < 100; };
  const auto in_square = [](double x, double y) { return x > 170 && x < 210 && y > 40 && y < 80; };
  const auto scene = [&](double time) {
    return make_pyramid(painted(128, 240, [&](double x, double y) {
      if (in_square(x - time * own.x, y - time * own.y))
        return pattern(300 + x - time * own.x, 700 + y - time * own.y);
      const double at = x - time * way.x;
      return in_stripes(at, y)
                 ? 128 + 60 * std::sin(2 * std::acos(-1.0) * at / period) + 8 * std::sin(0.4 * y)
                 : pattern(at, y);
    }));
  };
  const Pyramid here = scene(0), there = scene(1);
  Motion motion{track(here, there, find_corners(here, 8)), {}};
  motion.still = fit_two_view(motion.tracks, stillness, 0).value();
  int64_t striped = 0;
  for (Track& t : motion.tracks) {
    if (!in_stripes(t.from.x - 6, t.from.y) || !in_stripes(t.from.x + 6, t.from.y)) continue;
    t.to.x += period;
    ++striped;
  }
  const auto going = [&](const Vec2<double>& shift) {
    return std::count_if(motion.tracks.begin(), motion.tracks.end(),
                         [&](const Track& t) { return length(t.to - t.from - shift) < 0.5; });
  };
  const auto still = going(way), moving = going(own);
  EXPECT_GT(striped, 20);
  EXPECT_GT(moving, 8);
  look_again(motion, here, there);
  EXPECT_GT(going(way), still + striped * 9 / 10);
  EXPECT_EQ(going(own), moving);
}

TEST(MovingMask, IsTheSameOnAnyNumberOfThreads) {
  const std::atomic<bool> stop = false;
  const auto masks = [&](int threads) {
    set_threads(threads);
    return moving_masks(
        3, Stage::picture, [](int64_t, int64_t) { return std::nullopt; }, stop);
  };
  const auto one = masks(1), three = masks(3);
  set_threads(0);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_TRUE(std::equal(one[i].data(), one[i].data() + one[i].size(), three[i].data()));
  }
}

TEST(MovingMask, IsEmptyWhereNothingMovesByItself) {
  const std::atomic<bool> stop = false;
  const auto still = [](int64_t i) {
    Tensor<uint8_t> picture({96, 128, 1});
    for (int64_t y = 0; y < 96; ++y) {
      for (int64_t x = 0; x < 128; ++x)
        picture(y, x, 0) =
            static_cast<uint8_t>(pattern(static_cast<double>(x + 3 * i), static_cast<double>(y)));
    }
    return picture;
  };
  for (const auto& mask : moving_masks(
           4, still, [](int64_t, int64_t) { return std::nullopt; }, stop)) {
    for (const uint8_t value : mask.values()) ASSERT_EQ(value, 0);
  }
  const Tensor<uint8_t> empty = moving_mask({40, 60}, {});
  for (const uint8_t value : empty.values()) ASSERT_EQ(value, 0);
}

}  // namespace
}  // namespace traceflow::prepare
