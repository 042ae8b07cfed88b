#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "cli/program.h"

namespace traceflow::cli {

// How a call of the program ended and what it printed.
struct Outcome {
  int code;
  std::string out, err;
};

// words: of the command line, without the program's name.
inline Outcome run_with(std::vector<std::string> words) {
  words.insert(words.begin(), "traceflow");
  std::vector<const char*> arguments;
  arguments.reserve(words.size());
  for (const std::string& word : words) arguments.push_back(word.c_str());
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  Outcome outcome{run(static_cast<int>(arguments.size()), arguments.data()), "", ""};
  outcome.out = ::testing::internal::GetCapturedStdout();
  outcome.err = ::testing::internal::GetCapturedStderr();
  return outcome;
}

}  // namespace traceflow::cli
