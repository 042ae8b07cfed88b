#include "train/health.h"

#include <gtest/gtest.h>

#include <limits>

namespace traceflow {
namespace {

LossTerms at_psnr(double psnr) {
  LossTerms terms;
  terms.total = 0.1;
  terms.psnr = psnr;
  return terms;
}

TEST(Health, ASteadyRunIsSound) {
  Health health(NonFinite::stop, 5);
  for (int i = 0; i < 2000; ++i) EXPECT_EQ(health.check(at_psnr(20 + 0.001 * i), {}), "");
  EXPECT_TRUE(health.sound());
  EXPECT_NEAR(health.smoothed_psnr(), 22, 0.2);
}

TEST(Health, APhotographOfWhichNothingIsKnownSaysNothing) {
  Health health(NonFinite::stop, 5);
  LossTerms unknown = at_psnr(0);
  unknown.psnr.reset();
  for (int i = 0; i < 2000; ++i) EXPECT_EQ(health.check(i % 2 == 0 ? at_psnr(20) : unknown, {}), "");
  EXPECT_DOUBLE_EQ(health.smoothed_psnr(), 20);
}

TEST(Health, ACollapseIsReported) {
  Health health(NonFinite::stop, 5);
  for (int i = 0; i < 1000; ++i) ASSERT_EQ(health.check(at_psnr(25), {}), "");
  std::string reason;
  bool was_unsound_before = false;
  for (int i = 0; i < 1000 && reason.empty(); ++i) {
    reason = health.check(at_psnr(8), {});
    was_unsound_before = was_unsound_before || (reason.empty() && !health.sound());
  }
  EXPECT_NE(reason.find("PSNR fell"), std::string::npos);
  EXPECT_TRUE(was_unsound_before) << "saving must stop before the run does";
}

TEST(Health, AnExpectedFallIsForgiven) {
  Health health(NonFinite::stop, 5);
  for (int i = 0; i < 1000; ++i) ASSERT_EQ(health.check(at_psnr(25), {}), "");
  health.expect_fall();
  for (int i = 0; i < 1000; ++i) ASSERT_EQ(health.check(at_psnr(8 + 0.01 * i), {}), "") << i;
}

TEST(Health, ALossThatIsNotANumberEndsTheRun) {
  Health health(NonFinite::drop, 5);
  LossTerms terms = at_psnr(20);
  terms.total = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(health.check(terms, {}), "");
}

TEST(Health, GradientsThatAreNotNumbersStopOrAreCounted) {
  const NonFiniteGradients bad{3, "main.position, row 17"};
  Health stopping(NonFinite::stop, 5);
  EXPECT_NE(stopping.check(at_psnr(20), bad).find("main.position, row 17"), std::string::npos);
  Health dropping(NonFinite::drop, 5);
  EXPECT_EQ(dropping.check(at_psnr(20), bad), "");
  EXPECT_EQ(dropping.check(at_psnr(20), bad), "");
  EXPECT_EQ(dropping.dropped(), 6);
}

}  // namespace
}  // namespace traceflow
