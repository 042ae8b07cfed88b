#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>
#include <vector>

// The program in a world in which something goes wrong: a process of its own, which may be killed. It is this
// test's own binary, which runs as `traceflow` when that is its first argument (main.cpp).
namespace traceflow::faults {

// What failing_allocation and DiskFault::first may be besides: nothing is refused, and all are counted.
inline constexpr int64_t count_only = -1;

// Calls that the disk refuses: a write finds room for its first half alone, a sync or a renaming fails.
struct DiskFault {
  std::string file = {};  // a part of the path of what is concerned; empty: nothing is
  int64_t first = 0;      // of these calls, counted from 1; 0: none
  int64_t count = 1;      // how many, one after another
  std::string call = {};  // write, fsync, rename or flock; empty: each of the first three

  std::string to_text() const;
  static DiskFault from_text(const std::string& text);
};

struct World {
  int64_t file_bytes = 0;  // the largest file that may be written; 0: no limit
  DiskFault disk = {};
  int64_t failing_allocation = 0;       // the n-th, counted from 1; 0: none
  bool failing_from_there = false;      // all that follow too
  bool clock_jumps = false;             // the clock on the wall, at every look
  bool hangup_ignored = false;          // as under nohup
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

// What it does for the disk.
void arm_disk(const DiskFault& fault);
// While one stands, this process's disk refuses what the fault says.
class WatchedDisk {
 public:
  explicit WatchedDisk(const DiskFault& fault);
  ~WatchedDisk();
  WatchedDisk(const WatchedDisk&) = delete;
  WatchedDisk& operator=(const WatchedDisk&) = delete;

  // What the disk was asked while the last one stood, in order: "write NAME", "fsync NAME", "rename FROM TO".
  static std::vector<std::string> calls();
};

// How many allocations, or calls to the disk, a program made to its end, where its World wished to count
// them.
int64_t allocations_said(const std::string& error);
int64_t disk_calls_said(const std::string& error);

}  // namespace traceflow::faults
