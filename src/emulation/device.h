#pragma once

#include <cstddef>
#include <cstdint>

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

// How many kernels were started so far. Null, as is the next, in tests on a device.
[[gnu::weak]] int64_t launches();
// After `after` more kernels have been started, finds no memory for the next `times` tries to start one.
[[gnu::weak]] void refuse_launches(int64_t after, int64_t times);
// How often the pool was trimmed so far.
int64_t trims();

}  // namespace traceflow::emulation
