#pragma once

#include <cstddef>

// The emulated device's memory: a region of the host's that is closed to reading and writing but while a
// kernel or a copy runs, so that a host loop over a tensor of the device ends in a fault at the place of the
// mistake. Fresh memory holds NaNs, so that what a kernel reads before it was written shows.
namespace traceflow::emulation {

// Opens the memory for as long as it stands.
class DeviceAccess {
 public:
  DeviceAccess();
  ~DeviceAccess();
  DeviceAccess(const DeviceAccess&) = delete;
  DeviceAccess& operator=(const DeviceAccess&) = delete;
};

// Whether an address is in the memory.
bool on_device(const void* address);

// Bytes that are allocated now; and the largest that may be, for tests of what happens at the limit.
size_t allocated_bytes();
void limit_bytes(size_t limit);

}  // namespace traceflow::emulation
