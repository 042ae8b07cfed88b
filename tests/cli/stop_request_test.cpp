#include "cli/terminal/stop_request.h"

#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <thread>

namespace traceflow::cli {
namespace {

constexpr int asked = 7;

// What a process comes to that is sent a signal twice.
[[noreturn]] void end_after_two(int signal_number, std::chrono::milliseconds apart,
                                void (*inherited)(int) = SIG_DFL) {
  std::signal(signal_number, inherited);
  const std::atomic<bool>& stop = stop_on_signals();
  std::raise(signal_number);
  std::this_thread::sleep_for(apart);
  std::raise(signal_number);
  std::_Exit(stop ? asked : 0);
}

constexpr std::chrono::milliseconds at_once{0}, later{1100};

TEST(StopRequestDeathTest, ASignalThatComesTwiceAtOnceIsOneRequest) {
  for (const int number : {SIGINT, SIGTERM, SIGHUP})
    EXPECT_EXIT(end_after_two(number, at_once), testing::ExitedWithCode(asked), "") << number;
}

TEST(StopRequestDeathTest, ASecondOneLaterEndsTheProgram) {
  for (const int number : {SIGINT, SIGTERM})
    EXPECT_EXIT(end_after_two(number, later), testing::KilledBySignal(number), "");
}

TEST(StopRequestDeathTest, ATerminalHangsUpButOnce) {
  EXPECT_EXIT(end_after_two(SIGHUP, later), testing::ExitedWithCode(asked), "");
}

TEST(StopRequestDeathTest, WhatIsIgnoredStaysIgnored) {
  for (const int number : {SIGINT, SIGHUP})
    EXPECT_EXIT(end_after_two(number, at_once, SIG_IGN), testing::ExitedWithCode(0), "") << number;
}

}  // namespace
}  // namespace traceflow::cli
