#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>
#include <vector>

// The program in a world in which something goes wrong: a process of its own, which may be killed. It is this
// test's own binary, which runs as `traceflow` when that is its first argument (main.cpp).
namespace traceflow::faults {

struct World {
  int64_t file_bytes = 0;               // the largest file that may be written; 0: no limit
  int64_t failing_allocation = 0;       // the n-th, counted from 1; 0: none
  bool failing_from_there = false;      // all that follow too
  bool clock_jumps = false;             // the clock on the wall, at every look
  bool is_nobody = false;               // without the rights of the superuser, if the test has them
  std::string output = {}, error = {};  // files that take what is said; empty: kept for Outcome
  bool output_closed = false;
  bool error_closed = false;
};

struct Outcome {
  int code = -1;  // exit code, or minus the signal
  std::string output, error;
};

class Process {
 public:
  Process(const std::vector<std::string>& words, const World& world);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  // Whether it has ended by itself.
  bool has_ended();
  void send(int signal_number) const;
  Outcome wait();

 private:
  pid_t process_ = -1;
  bool reaped_ = false;
  int status_ = 0;
  std::string output_, error_;  // files
};

// The words after `traceflow`.
Outcome run(const std::vector<std::string>& words, const World& world = {});

// In the process that runs as the program: lets happen what the world of its parent says.
void arm();
// While one stands, this process is refused all memory.
struct NoMemory {
  NoMemory();
  ~NoMemory();
  NoMemory(const NoMemory&) = delete;
  NoMemory& operator=(const NoMemory&) = delete;
};
// While one stands, this process is refused the n-th of its requests, counted from 1.
struct RefusedOnce {
  explicit RefusedOnce(int64_t n);
  ~RefusedOnce();
  RefusedOnce(const RefusedOnce&) = delete;
  RefusedOnce& operator=(const RefusedOnce&) = delete;
};

// How many allocations a program made to its end, as its World wished: with failing_allocation = count_only.
inline constexpr int64_t count_only = -1;
int64_t allocations_said(const std::string& error);

}  // namespace traceflow::faults
