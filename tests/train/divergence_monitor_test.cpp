#include "train/divergence_monitor.h"

#include <gtest/gtest.h>

#include <limits>

namespace traceflow {
namespace {

LossValues at_psnr(double psnr) {
  LossValues terms;
  terms.total = 0.1;
  terms.psnr = psnr;
  return terms;
}

TEST(DivergenceMonitor, ASteadyRunIsSound) {
  DivergenceMonitor monitor(NonFinite::stop, 5);
  for (int i = 0; i < 2000; ++i) EXPECT_EQ(monitor.check(at_psnr(20 + 0.001 * i), {}), "");
  EXPECT_TRUE(monitor.sound());
  EXPECT_NEAR(monitor.smoothed_psnr(), 22, 0.2);
}

TEST(DivergenceMonitor, APhotographOfWhichNothingIsKnownSaysNothing) {
  DivergenceMonitor monitor(NonFinite::stop, 5);
  LossValues unknown = at_psnr(0);
  unknown.psnr.reset();
  for (int i = 0; i < 2000; ++i) EXPECT_EQ(monitor.check(i % 2 == 0 ? at_psnr(20) : unknown, {}), "");
  EXPECT_DOUBLE_EQ(monitor.smoothed_psnr(), 20);
}

TEST(DivergenceMonitor, ACollapseIsReported) {
  DivergenceMonitor monitor(NonFinite::stop, 5);
  for (int i = 0; i < 1000; ++i) ASSERT_EQ(monitor.check(at_psnr(25), {}), "");
  std::string reason;
  bool was_unsound_before = false;
  for (int i = 0; i < 1000 && reason.empty(); ++i) {
    reason = monitor.check(at_psnr(8), {});
    was_unsound_before = was_unsound_before || (reason.empty() && !monitor.sound());
  }
  EXPECT_NE(reason.find("PSNR fell"), std::string::npos);
  EXPECT_TRUE(was_unsound_before) << "saving must stop before the run does";
}

TEST(DivergenceMonitor, AnExpectedFallIsForgiven) {
  DivergenceMonitor monitor(NonFinite::stop, 5);
  for (int i = 0; i < 1000; ++i) ASSERT_EQ(monitor.check(at_psnr(25), {}), "");
  monitor.expect_fall();
  for (int i = 0; i < 1000; ++i) ASSERT_EQ(monitor.check(at_psnr(8 + 0.01 * i), {}), "") << i;
}

TEST(DivergenceMonitor, ALossThatIsNotANumberEndsTheRun) {
  DivergenceMonitor monitor(NonFinite::drop, 5);
  LossValues terms = at_psnr(20);
  terms.total = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(monitor.check(terms, {}), "");
}

TEST(DivergenceMonitor, GradientsThatAreNotNumbersStopOrAreCounted) {
  const NonFiniteGradients bad{3, "main.position, row 17"};
  DivergenceMonitor stopping(NonFinite::stop, 5);
  EXPECT_NE(stopping.check(at_psnr(20), bad).find("main.position, row 17"), std::string::npos);
  DivergenceMonitor dropping(NonFinite::drop, 5);
  EXPECT_EQ(dropping.check(at_psnr(20), bad), "");
  EXPECT_EQ(dropping.check(at_psnr(20), bad), "");
  EXPECT_EQ(dropping.dropped(), 6);
}

}  // namespace
}  // namespace traceflow
