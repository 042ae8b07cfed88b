#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

// Where the time of a run goes. Every step opens a Scope under its name; the table falls out at the end.
namespace traceflow::profile {

struct Entry {
  std::string name;
  int64_t calls = 0;
  double seconds = 0;
};

// Measures from construction to destruction, on the thread that opened it. Costs a clock read when profiling
// is on and one relaxed load when it is off. `name` must outlive the program (a literal).
class Scope {
 public:
  explicit Scope(const char* name);
  ~Scope();
  Scope(const Scope&) = delete;
  Scope& operator=(const Scope&) = delete;

 private:
  const char* name_;
  std::chrono::steady_clock::time_point start_;
};

// Off at the start. Scopes opened inside a parallel region are not recorded. While it is on, work on the CUDA
// device is waited for kernel by kernel (base/kernel.h, base/device_memory.cpp): each time is its own, and
// the whole takes longer.
void enable(bool on);
bool is_on();
// All entries since the last clear(), in the order in which their names were first seen.
std::vector<Entry> entries();
void clear();

}  // namespace traceflow::profile
