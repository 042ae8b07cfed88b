#include "cli/program.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "base/parallel.h"
#include "cli/error_boundary.h"

namespace traceflow::cli {
namespace {

using ::testing::HasSubstr;

struct Outcome {
  int code;
  std::string out, err;
};

Outcome run_with(std::vector<const char*> arguments) {
  arguments.insert(arguments.begin(), "traceflow");
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  Outcome result{run(static_cast<int>(arguments.size()), arguments.data()), "", ""};
  result.out = testing::internal::GetCapturedStdout();
  result.err = testing::internal::GetCapturedStderr();
  return result;
}

int lines(const std::string& text) { return static_cast<int>(std::count(text.begin(), text.end(), '\n')); }

TEST(Program, SaysItsVersion) {
  const Outcome o = run_with({"--version"});
  EXPECT_EQ(o.code, exit_done);
  EXPECT_THAT(o.out, testing::MatchesRegex("traceflow [0-9]+\\.[0-9]+\\.[0-9]+\n"));
}

TEST(Program, HelpNamesEveryVerbAndEveryVerbHasHelp) {
  const Outcome o = run_with({"--help"});
  EXPECT_EQ(o.code, exit_done);
  for (const char* verb : {"eval", "export", "inspect", "render", "synth", "trace", "train"}) {
    EXPECT_THAT(o.out, HasSubstr(std::string("\n  ") + verb + " "));
    const Outcome help = run_with({verb, "--help"});
    EXPECT_EQ(help.code, exit_done);
    EXPECT_THAT(help.out, HasSubstr(std::string("traceflow ") + verb));
  }
}

TEST(Program, ArgumentsThatCannotBeUsedAreOneLineAndCode2) {
  for (const std::vector<const char*>& arguments :
       std::vector<std::vector<const char*>>{{"fly"},
                                             {"--threads", "many"},
                                             {"train"},
                                             {"train", "-o", "x", "--no-such-flag"},
                                             {"train", "-o", "x", "--set", "loss.nromal=1"},
                                             {"train", "-o", "x", "-d", "y", "--set", "loss.lpips=1"},
                                             {"train", "-d", "/nowhere", "-o", "/tmp/traceflow_no_run"},
                                             {"inspect", "-d", "/nowhere"}}) {
    const Outcome o = run_with(arguments);
    EXPECT_EQ(o.code, exit_input) << arguments.back();
    EXPECT_EQ(lines(o.err), 1) << o.err;
    EXPECT_THAT(o.err, testing::StartsWith("traceflow: "));
    EXPECT_EQ(o.out, "");
  }
}

TEST(Program, WithoutAVerbShowsTheHelpAndFails) {
  const Outcome o = run_with({});
  EXPECT_EQ(o.code, exit_input);
  EXPECT_THAT(o.err, HasSubstr("Usage"));
}

TEST(Program, ThreadsAreSetBeforeTheVerbRunsOnEitherSideOfItsName) {
  run_with({"--threads", "3", "inspect", "-d", "/nowhere"});
  EXPECT_EQ(thread_count(), 3);
  run_with({"inspect", "-d", "/nowhere", "--threads", "2"});
  EXPECT_EQ(thread_count(), 2);
  set_threads(0);
}

TEST(Program, UnknownOptionsAreAnsweredWithTheNearest) {
  EXPECT_THAT(run_with({"train", "-o", "x", "--set", "loss.nromal=1"}).err,
              HasSubstr("did you mean loss.normal?"));
}

}  // namespace
}  // namespace traceflow::cli
