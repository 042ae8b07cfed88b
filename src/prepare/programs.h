#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/work.h"

// Runs the external programs that provide images and poses.
namespace traceflow::prepare {

// Throws InputError, with installation advice, if the program is missing.
void need_program(const std::string& program);

// A program's progress, from its latest output.
struct Share {
  int64_t done = 0, all = 0;
};
using ReadShare = std::function<std::optional<Share>(const std::string& said)>;

// Runs a program to its end. Its output goes to a log, whose end is passed to `read_share` from time to time.
// Throws InputError with the log's last line if the program fails, and Stopped.
void run_program(const std::vector<std::string>& words, const std::filesystem::path& log, const Work& work,
                 const ReadShare& read_share);

// The last line of a log that is not empty.
std::string last_line(const std::filesystem::path& log);

}  // namespace traceflow::prepare
