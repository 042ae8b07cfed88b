#include "cli/terminal/error_boundary.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <new>
#include <sstream>
#include <system_error>

#include "base/error.h"

namespace traceflow::cli {
namespace {

struct Guarded {
  int code;
  std::string line;
};

Guarded outcome(const std::function<int()>& work) {
  std::ostringstream err;
  const int code = guarded(work, err);
  return {code, err.str()};
}

TEST(ErrorBoundary, PassesTheCodeOfWhatSucceeds) {
  const Guarded o = outcome([] { return 0; });
  EXPECT_EQ(o.code, 0);
  EXPECT_EQ(o.line, "");
}

TEST(ErrorBoundary, InputErrorsAreOneLineAndCode2) {
  const Guarded o =
      outcome([]() -> int { throw InputError("a.json", "scale", "x\ny", "a number", "mend it"); });
  EXPECT_EQ(o.code, 2);
  EXPECT_EQ(o.line, "traceflow: a.json: scale: found x?y, expected a number; mend it\n");
}

TEST(ErrorBoundary, StreamsAndThreadsThatTheSystemRefusesAreNoBugs) {
  const Guarded o = outcome([]() -> int {
    throw std::system_error(std::make_error_code(std::errc::no_space_on_device), "standard output");
  });
  EXPECT_EQ(o.code, 2);
  EXPECT_EQ(o.line, "traceflow: standard output: No space left on device\n");
}

TEST(ErrorBoundary, FilesThatTheSystemRefusesAreInputErrors) {
  const Guarded o = outcome([]() -> int { return std::filesystem::file_size("/nowhere") != 0; });
  EXPECT_EQ(o.code, 2);
  EXPECT_NE(o.line.find("/nowhere"), std::string::npos);
}

TEST(ErrorBoundary, BrokenPromisesAreCalledBugsAndCode3) {
  const Guarded o = outcome([]() -> int { throw InternalError("count is 3"); });
  EXPECT_EQ(o.code, 3);
  EXPECT_NE(o.line.find("internal error: count is 3; this is a bug"), std::string::npos);
  EXPECT_EQ(outcome([]() -> int { throw std::out_of_range("at"); }).code, 3);
  EXPECT_EQ(outcome([]() -> int { throw 7; }).code, 3);
}

TEST(ErrorBoundary, AVerbThatHasSaidEverythingOnlyGivesItsCode) {
  const Guarded o = outcome([]() -> int { throw Exit{exit_interrupted}; });
  EXPECT_EQ(o.code, 130);
  EXPECT_EQ(o.line, "");
}

TEST(ErrorBoundary, MemoryIsCode4AndOneLine) {
  const Guarded o = outcome([]() -> int { throw std::bad_alloc(); });
  EXPECT_EQ(o.code, 4);
  EXPECT_EQ(std::count(o.line.begin(), o.line.end(), '\n'), 1);
}

void run_where_nothing_may_be_thrown(const std::function<void()>& work) noexcept { work(); }

TEST(ErrorBoundary, WhatIsThrownWhereNothingMayBeStillEndsInItsLineAndCode) {
  const auto end = [] {
    guard_termination();
    run_where_nothing_may_be_thrown([] { throw std::bad_alloc(); });
  };
  EXPECT_EXIT(end(), testing::ExitedWithCode(exit_memory), "^traceflow: out of memory; try [^\n]*\n$");
}

}  // namespace
}  // namespace traceflow::cli
