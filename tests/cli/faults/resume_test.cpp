#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cli/faults/small_training.h"

// `train --resume` with what cannot be had, or changes more than it seems.
namespace traceflow::faults {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class Resume : public Faults {
 protected:
  void SetUp() override { ASSERT_EQ(run(training("resumed", {"-i", "6"})).code, 0); }
  void TearDown() override { fs::remove_all(path("resumed")); }
  static Outcome resume_with(const std::vector<std::string>& more) {
    std::vector<std::string> words = resuming("resumed");
    words.insert(words.end(), more.begin(), more.end());
    return run(words);
  }
};

TEST_F(Resume, WhatTheCheckpointHoldsAlreadyIsNotChanged) {
  const std::string before = state_of(path("resumed"));
  const Outcome width = resume_with({"--set", "deform.network.width=32"});
  expect_one_line(width, 2);
  EXPECT_THAT(width.error, HasSubstr("--resume: deform.network.width: found 32, expected 16"));
  for (const char* setting : {"initial.tint=0.5", "deform.main=false", "specular=none", "seed=2"})
    expect_one_line(resume_with({"--set", setting}), 2);
  EXPECT_TRUE(state_of(path("resumed")) == before);
  // The same value, and what only steers.
  const Outcome same =
      resume_with({"--set", "deform.network.width=16", "--set", "rates.sh=0.001", "-i", "7"});
  EXPECT_EQ(same.code, 0) << same.error;
}

TEST_F(Resume, APresetIsTakenWhereItIsTheRunsOwn) {
  const Outcome other = resume_with({"--preset", "cpu"});
  expect_one_line(other, 2);
  EXPECT_THAT(other.error, AllOf(HasSubstr("--preset: "), HasSubstr(" in cpu, expected "),
                                 HasSubstr("leave --preset out")));
  std::vector<std::string> again = training("resumed", {"-i", "7"});
  again.emplace_back("--resume");
  const Outcome same = run(again);
  EXPECT_EQ(same.code, 0) << same.error;
}

TEST_F(Resume, OtherInstructionsAreSaid) {
  std::vector<std::string> words = resuming("resumed");
  words.erase(std::find(words.begin(), words.end(), "-q"));
  words.insert(words.end(), {"-i", "7", "--instructions", "sse4"});
  const Outcome end = run(words);
  EXPECT_EQ(end.code, 0) << end.error;
  EXPECT_THAT(end.error, AllOf(HasSubstr(" and goes on on the CPU with "), HasSubstr("(oneDNN: sse4)"),
                               HasSubstr("other bytes")));
}

}  // namespace
}  // namespace traceflow::faults
