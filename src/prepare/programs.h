#pragma once

#include <atomic>
#include <filesystem>
#include <string>
#include <vector>

// The programs of others that pictures and poses come from.
namespace traceflow::prepare {

// Thrown where the user has asked to stop; nothing is lost by it.
struct Stopped {};

// Throws InputError where a program is not there, which says how to get it.
void need_program(const std::string& program);

// Runs a program to its end, everything that it says going to a log. Throws InputError with the log's last
// line where it fails, and Stopped.
void run_program(const std::vector<std::string>& words, const std::filesystem::path& log,
                 const std::atomic<bool>& stop);

// What a log ends with: its last line that is not empty.
std::string last_line(const std::filesystem::path& log);

}  // namespace traceflow::prepare
