#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

// Measures where the time of a run goes. Every step opens a Scope with its name; entries() gives the table.
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

// Initially off. Scopes opened inside a parallel region are not recorded. While profiling is on, the host
// waits for the CUDA device after each kernel (base/kernel.h, base/device_memory.cpp): each time is exact,
// and the whole takes longer.
void enable(bool on);
bool is_on();
// All entries since the last clear(), in the order in which their names first appeared.
std::vector<Entry> entries();
void clear();

}  // namespace traceflow::profile
