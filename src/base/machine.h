#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "base/device.h"

namespace traceflow {

// The machine that a program runs on, for records of its runs.
struct Machine {
  std::string processor;
  int threads = 0;  // of the processor
  int64_t memory_bytes = 0;
  std::string system;  // kernel and architecture
  std::string gpu;     // empty if none is used
};

// The machine that this program runs on. Unknown values are empty or 0.
Machine this_machine(Device device);

// Memory that this process uses now: resident, or on the device for CUDA. 0 if unknown.
int64_t memory_in_use(Device device);

// Memory that this process could still allocate on this machine. A large number if unknown.
int64_t memory_available();

// Parse the texts of /proc/cpuinfo (empty if it has no name of the processor), /proc/meminfo and
// /proc/self/statm (0 if they lack the number).
std::string processor_name(std::string_view cpuinfo);
int64_t total_memory(std::string_view meminfo);
int64_t resident_memory(std::string_view statm, int64_t page_bytes);

}  // namespace traceflow
