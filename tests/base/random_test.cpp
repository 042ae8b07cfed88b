#include "base/random.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>

namespace traceflow {
namespace {

// Oracle: the numbers that the authors' own programs print.
TEST(Random, IsXoshiro256StarStar) {
  Random random;
  random.set_state({1, 2, 3, 4});
  for (const uint64_t expected :
       {UINT64_C(11520), UINT64_C(0), UINT64_C(1509978240), UINT64_C(1215971899390074240),
        UINT64_C(1216172134540287360), UINT64_C(607988272756665600), UINT64_C(16172922978634559625),
        UINT64_C(8476171486693032832)}) {
    EXPECT_EQ(random.next(), expected);
  }
}

TEST(Random, SeedIsSpreadBySplitmix) {
  EXPECT_EQ(Random(1234567).state(),
            (Random::State{UINT64_C(6457827717110365317), UINT64_C(3203168211198807973),
                           UINT64_C(9817491932198370423), UINT64_C(4593380528125082431)}));
}

RC_GTEST_PROP(RandomProperty, ARestoredStateContinuesTheSameNumbers, (uint64_t seed)) {
  Random random(seed);
  const auto drawn = *rc::gen::inRange(0, 50);
  for (int i = 0; i < drawn; ++i) random.normal();
  Random other(seed + 1);
  other.set_state(random.state());
  for (int i = 0; i < 20; ++i) {
    RC_ASSERT(random.next() == other.next());
    RC_ASSERT(random.uniform() == other.uniform());
    RC_ASSERT(random.normal() == other.normal());
    RC_ASSERT(random.below(1000) == other.below(1000));
  }
}

RC_GTEST_PROP(RandomProperty, NumbersStayInTheirRange, (uint64_t seed)) {
  Random random(seed);
  const auto n = *rc::gen::inRange<int64_t>(1, 1'000'000);
  for (int i = 0; i < 100; ++i) {
    const double u = random.uniform();
    RC_ASSERT(u >= 0 && u < 1);
    const int64_t k = random.below(n);
    RC_ASSERT(k >= 0 && k < n);
    const double v = random.uniform(-3, 5);
    RC_ASSERT(v >= -3 && v < 5);
    RC_ASSERT(std::isfinite(random.normal()));
  }
}

// Oracle: the moments of the distributions, six standard errors either way.
TEST(Random, MomentsAreThoseOfTheDistributions) {
  constexpr int count = 200'000;
  Random random(7);
  double uniform = 0, normal = 0, normal2 = 0, normal4 = 0;
  for (int i = 0; i < count; ++i) {
    uniform += random.uniform();
    const double x = random.normal();
    normal += x;
    normal2 += x * x;
    normal4 += x * x * x * x;
  }
  const double error = 6 / std::sqrt(static_cast<double>(count));
  EXPECT_NEAR(uniform / count, 0.5, error * std::sqrt(1.0 / 12));
  EXPECT_NEAR(normal / count, 0, error);
  EXPECT_NEAR(normal2 / count, 1, error * std::sqrt(2.0));
  EXPECT_NEAR(normal4 / count, 3, error * std::sqrt(96.0));
}

}  // namespace
}  // namespace traceflow
