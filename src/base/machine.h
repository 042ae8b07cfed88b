#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "base/device.h"

namespace traceflow {

// What a program runs on, for records of what it did.
struct Machine {
  std::string processor;
  int threads = 0;  // of the processor
  int64_t memory_bytes = 0;
  std::string system;  // kernel and architecture
  std::string gpu;     // empty where none is used
};

// The machine that this program runs on. What the system does not tell stays empty or 0.
Machine this_machine(Device device);

// Memory that this process has in use now: resident, or on the device where that is CUDA. 0 where the system
// does not tell.
int64_t memory_in_use(Device device);

// Memory that this machine could still give to this process. Much where the system does not tell.
int64_t memory_available();

// Of the texts of /proc/cpuinfo (empty where the processor has no name there), /proc/meminfo and
// /proc/self/statm (0 where they do not say).
std::string processor_name(std::string_view cpuinfo);
int64_t total_memory(std::string_view meminfo);
int64_t resident_memory(std::string_view statm, int64_t page_bytes);

}  // namespace traceflow
