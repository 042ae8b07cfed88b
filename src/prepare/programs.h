#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/work.h"

// The programs of others that pictures and poses come from.
namespace traceflow::prepare {

// Throws InputError where a program is not there, which says how to get it.
void need_program(const std::string& program);

// How far a program is, by what it has said last.
struct Share {
  int64_t done = 0, all = 0;
};
using ReadShare = std::function<std::optional<Share>(const std::string& said)>;

// Runs a program to its end, everything that it says going to a log, whose end `read_share` is given from
// time to time. Throws InputError with the log's last line where it fails, and Stopped.
void run_program(const std::vector<std::string>& words, const std::filesystem::path& log, const Work& work,
                 const ReadShare& read_share);

// What a log ends with: its last line that is not empty.
std::string last_line(const std::filesystem::path& log);

}  // namespace traceflow::prepare
