#include "cli/terminal/progress.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

namespace traceflow::cli {
namespace {

using ::testing::HasSubstr;

events::Step step_at(int64_t iteration, double seconds) {
  events::Step e;
  e.iteration = iteration;
  e.iterations = 1000;
  e.phase = "joint";
  e.loss = 0.04561;
  e.psnr = 27.314;
  e.seconds = seconds;
  e.rate = 12.5;
  e.surfels = {12'700, 3'200};
  return e;
}

int lines_in(const std::string& text) { return static_cast<int>(std::count(text.begin(), text.end(), '\n')); }

TEST(ProgressText, Durations) {
  EXPECT_EQ(duration_text(0.4), "0 s");
  EXPECT_EQ(duration_text(59.4), "59 s");
  EXPECT_EQ(duration_text(59.6), "1:00");
  EXPECT_EQ(duration_text(125), "2:05");
  EXPECT_EQ(duration_text(3723), "1:02:03");
  EXPECT_EQ(duration_text(-1), "?");
  EXPECT_EQ(duration_text(std::nan("")), "?");
  EXPECT_EQ(duration_text(INFINITY), "?");
}

TEST(ProgressText, Counts) {
  EXPECT_EQ(count_text(0), "0");
  EXPECT_EQ(count_text(999), "999");
  EXPECT_EQ(count_text(12'700), "12.7k");
  EXPECT_EQ(count_text(999'949), "999.9k");
  EXPECT_EQ(count_text(1'250'000), "1.25M");
}

TEST(ProgressText, StatusLineHoldsEveryFigure) {
  EXPECT_EQ(status_line(step_at(500, 40), 0),
            " 50%  40 s left  joint  PSNR 27.31  loss 0.0456  500/1000  12.5 it/s  12.7k+3.2k surfels");
  EXPECT_THAT(status_line(step_at(500, 40), 200), HasSubstr("[==========          ]   50%  40 s left"));
}

TEST(ProgressText, StatusLineNeverExceedsTheTerminal) {
  for (int width = 1; width < 150; ++width) {
    EXPECT_LT(status_line(step_at(500, 40), width).size(), static_cast<size_t>(width)) << width;
  }
}

TEST(ProgressText, FiguresThatAreNotFiniteAreShownAsSuch) {
  events::Step e = step_at(1, 1);
  e.rate = 0;
  e.loss = std::nan("");
  EXPECT_THAT(status_line(e, 0), HasSubstr("? left"));
  EXPECT_THAT(status_line(e, 0), HasSubstr("loss nan"));
  e.iterations = 0;
  EXPECT_THAT(status_line(e, 80), HasSubstr("100%"));
}

TEST(Progress, WritesALineEveryFivePercentOrFifteenSecondsWhereThereIsNoTerminal) {
  std::ostringstream fast;
  Progress fast_progress(fast, 0);
  for (int64_t i = 1; i <= 1000; ++i) fast_progress(step_at(i, 0.001 * static_cast<double>(i)));
  EXPECT_EQ(lines_in(fast.str()), 21);  // 0 %, 5 %, …, 100 %
  EXPECT_THAT(fast.str(), Not(HasSubstr("\r")));

  std::ostringstream slow;
  Progress slow_progress(slow, 0);
  for (int64_t i = 1; i <= 9; ++i) slow_progress(step_at(i, 10.0 * static_cast<double>(i)));
  EXPECT_EQ(lines_in(slow.str()), 5);  // every second one: 10, 30, 50, 70, 90 s
}

TEST(Progress, RedrawsOneLineOnATerminalAndClearsItForOthers) {
  std::ostringstream out;
  Progress progress(out, 80);
  progress(step_at(1, 0.00));
  progress(step_at(2, 0.05));
  progress(step_at(3, 0.20));
  EXPECT_EQ(lines_in(out.str()), 0);
  const std::string drawn = out.str();
  EXPECT_EQ(std::count(drawn.begin(), drawn.end(), '\r'), 2);
  progress(events::Warning{3, "low disk space"});
  EXPECT_THAT(out.str(), testing::EndsWith("\r\x1b[Kwarning: low disk space\n"));
  progress(events::PhaseEntered{4, "specular"});
  EXPECT_THAT(out.str(), testing::EndsWith("\nphase specular from iteration 4\n"));
}

TEST(Progress, TellsWhichPointsMainSurfelsStartAt) {
  events::Started start{"plate", "runs/plate", 0, 1000, "cpu", 2, 1, {500, 0}, 5 << 20, "1.0", {}, 900, 600};
  std::ostringstream some, all, resumed;
  Progress(some, 0)(start);
  EXPECT_THAT(some.str(),
              HasSubstr("\nmain surfels start at the 600 of 900 points that training views see\n"));
  start.points_in_view = 900;
  Progress(all, 0)(start);
  start.points_in_view = 600;
  start.iteration = 100;
  Progress(resumed, 0)(start);
  EXPECT_EQ(lines_in(all.str()), 1);
  EXPECT_EQ(lines_in(resumed.str()), 1);
}

TEST(Progress, OfAQuietRunWarningsAloneAreShown) {
  std::ostringstream out;
  const events::Listener quiet = warnings_alone(out);
  quiet(events::Started{"plate", "runs/plate", 0, 1000, "cpu", 2, 1, {500, 0}, 5 << 20, "1.0", {}});
  quiet(events::Warning{0, "masks are missing"});
  quiet(events::PhaseEntered{0, "diffuse"});
  for (int64_t i = 1; i <= 1000; ++i) quiet(step_at(i, 0.1 * static_cast<double>(i)));
  quiet(events::Warning{1000, "iteration 1000 is not saved"});
  quiet(events::Saved{1000, "runs/plate/state.safetensors", 0.1});
  quiet(events::Finished{events::Ending::completed, 1000, 61, 12.25, {500, 40}, ""});
  EXPECT_EQ(out.str(), "warning: masks are missing\nwarning: iteration 1000 is not saved\n");
}

TEST(Progress, TellsHowARunBeginsAndEnds) {
  std::ostringstream out;
  Progress progress(out, 0);
  progress(events::Started{"plate", "runs/plate", 200, 1000, "cpu", 2, 1, {500, 0}, 5 << 20, "1.0", {}});
  progress(events::Saved{1000, "runs/plate/state.safetensors", 0.1});
  progress(events::Evaluated{1000, "test", 4, 25.5, 0.9, 3});
  progress(events::Finished{events::Ending::diverged, 700, 61, 12.25, {500, 40}, "main.position[3] is nan"});
  EXPECT_EQ(out.str(),
            "plate: 1000 iterations from 200 on 2 threads, 500 surfels, at most 5 MiB -> runs/plate\n"
            "saved runs/plate/state.safetensors at iteration 1000\n"
            "iteration 1000: PSNR 25.50 dB, SSIM 0.9000 over 4 test views\n"
            "diverged after 700 iterations and 1:01: PSNR 12.25 dB over the last views, 500+40 surfels; "
            "main.position[3] is nan\n");
}

}  // namespace
}  // namespace traceflow::cli
