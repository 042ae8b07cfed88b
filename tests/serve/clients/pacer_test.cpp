#include "serve/clients/pacer.h"

#include <gtest/gtest.h>

#include <limits>

namespace traceflow::serve {
namespace {

constexpr double full = 960 * 540;
constexpr double nothing_shown = std::numeric_limits<double>::infinity();

// A machine on which a frame costs so much, and a link to it.
struct World {
  double fixed = 0.02, per_pixel = 0;
  double bytes_per_pixel = 0.1, bytes_a_second = 1e9;

  double seconds(double pixels) const { return fixed + per_pixel * pixels; }
  void frame(Pacer& pacer, const Coarseness& c) const {
    const double pixels = full / (c.divisor * c.divisor);
    pacer.rendered(pixels, seconds(pixels), pixels * bytes_per_pixel, c.quality);
    pacer.displayed(pixels * bytes_per_pixel, pixels * bytes_per_pixel / bytes_a_second);
  }
  // Where the pacer settles while the camera moves.
  double settled(Pacer& pacer) const {
    for (int i = 0; i < 40; ++i) frame(pacer, pacer.moving(full));
    return pacer.moving(full).divisor;
  }
};

TEST(CostLine, RecoversALine) {
  CostLine line;
  for (int i = 1; i < 20; ++i) line.add(100.0 * i, 0.5 + 0.01 * 100.0 * i);
  EXPECT_NEAR(line.seconds(700), 7.5, 1e-9);
  EXPECT_NEAR(line.seconds(0), 0.5, 1e-9);
}

TEST(CostLine, OfOneSizeIsTakenToGoWithTheSize) {
  CostLine line;
  for (int i = 0; i < 5; ++i) line.add(100, 2);
  EXPECT_DOUBLE_EQ(line.seconds(50), 1);
  EXPECT_DOUBLE_EQ(line.seconds(100), 2);
}

TEST(CostLine, IsNeverNegativeWhateverItIsFed) {
  CostLine line;
  line.add(100, 1);
  line.add(200, 0.1);
  line.add(1000, 5);
  line.add(2000, 20);
  for (const double size : {0.0, 1.0, 150.0, 1e6}) EXPECT_GE(line.seconds(size), 0) << size;
}

TEST(CostLine, ForgetsWhatWas) {
  CostLine line;
  for (int i = 0; i < 50; ++i) line.add(100 + i % 3, 1);
  for (int i = 0; i < 100; ++i) line.add(100 + i % 3, 3);
  EXPECT_NEAR(line.seconds(101), 3, 0.05);
}

TEST(Pacer, BeginsCoarse) {
  EXPECT_GT(Pacer().moving(full).divisor, 1);
  EXPECT_FALSE(Pacer().moving(full).final);
}

TEST(Pacer, GoesToFullSizeWhereFramesAreCheap) {
  Pacer pacer;
  EXPECT_EQ((World{0.001, 1e-9}).settled(pacer), 1);
}

// The frames that it settles on fit into their time, and the next finer ones would not.
TEST(Pacer, SettlesOnTheFinestThatFits) {
  for (const double per_pixel : {1e-7, 2e-7, 1e-6, 3e-6}) {
    const World world{0.02, per_pixel};
    Pacer pacer;
    const double divisor = world.settled(pacer);
    EXPECT_LE(world.seconds(full / (divisor * divisor)), 0.06 * 1.01) << per_pixel;
    EXPECT_GT(world.seconds(full / (divisor * divisor) * 2.3), 0.06) << per_pixel;
  }
}

TEST(Pacer, MakesSmallerFramesForASlowLink) {
  Pacer near, far;
  World world{0.001, 1e-9};
  world.settled(near);
  world.bytes_a_second = 50'000;
  const double divisor = world.settled(far);
  EXPECT_GT(divisor, near.moving(full).divisor);
  EXPECT_LE(full / (divisor * divisor) * world.bytes_per_pixel / world.bytes_a_second, 0.15 * 1.3);
}

TEST(Pacer, GivesUpQualityBeforeSizeOnASlowLink) {
  World world{0.001, 1e-9};
  Pacer pacer;
  world.settled(pacer);
  const int best = pacer.moving(full).quality;
  // A little too slow for the frames as they are.
  world.bytes_a_second = full * world.bytes_per_pixel / 0.17;
  world.settled(pacer);
  EXPECT_EQ(pacer.moving(full).divisor, 1);
  EXPECT_LT(pacer.moving(full).quality, best);
}

// At rest every frame is finer than the one before and the last is full and final, however slow the machine.
TEST(Pacer, RefinesToTheEnd) {
  for (const double per_pixel : {1e-9, 1e-6, 1e-4}) {
    const World world{0.02, per_pixel};
    Pacer pacer;
    world.settled(pacer);
    double shown = nothing_shown;
    Coarseness c;
    int frames = 0;
    do {
      c = pacer.finer(full, shown);
      EXPECT_TRUE(c.divisor < shown || (c.final && c.divisor == shown)) << per_pixel;
      shown = c.divisor;
      world.frame(pacer, c);
    } while (!c.final && ++frames < 20);
    EXPECT_TRUE(c.final);
    EXPECT_EQ(c.divisor, 1);
  }
}

TEST(Pacer, SharpensAFrameThatMovedAtFullSize) {
  Pacer pacer;
  (World{0.001, 1e-9}).settled(pacer);
  const Coarseness moving = pacer.moving(full), rest = pacer.finer(full, 1);
  EXPECT_EQ(rest.divisor, 1);
  EXPECT_TRUE(rest.final);
  EXPECT_GT(rest.quality, moving.quality);
}

}  // namespace
}  // namespace traceflow::serve
