#pragma once

#include <cstddef>
#include <cstdint>
#include <new>
#include <string>

#include "base/device.h"

// Memory on a device, and what is known of the device. All work on the CUDA device is put on one stream, in
// the order in which it is called; what is read back has been waited for.
namespace traceflow::memory {

// A device that has no memory left: how much was asked for (0: the driver asked) and how much is there.
class OutOfMemory : public std::bad_alloc {
 public:
  OutOfMemory(size_t wanted, size_t available);
  const char* what() const noexcept override { return text_.c_str(); }

 private:
  std::string text_;
};

// `bytes` on the device, aligned to 64 bytes or more. Throws OutOfMemory.
void* allocate(Device device, size_t bytes);
void release(Device device, void* memory, size_t bytes) noexcept;
// Between any two devices. The host waits where it is the one that reads.
void copy(Device to_device, void* to, Device from_device, const void* from, size_t bytes);
void zero(Device device, void* memory, size_t bytes);
// Waits for all work on the device; nothing to wait for on the CPU.
void synchronise(Device device);

// Bytes that stand on the CUDA device now, and the most that ever did.
size_t device_bytes();
size_t most_device_bytes();
// How often memory was asked for there, so far.
int64_t device_allocations();
// The most that may stand there: what goes beyond throws OutOfMemory. No limit but the device's own until it
// is set.
void set_device_budget(size_t bytes);

}  // namespace traceflow::memory

namespace traceflow::cuda {

// Whether steps on the CUDA device add up in an order that is the same every run, where that costs time. Off
// until it is set.
bool deterministic();
void set_deterministic(bool on);

}  // namespace traceflow::cuda

// The CUDA side of the same, defined where the program is built with CUDA (device_cuda.cu), or with the
// tests' emulation of it; null elsewhere.
namespace traceflow::cuda {

struct DeviceFacts {
  std::string name;  // as the driver tells it
  int major = 0, minor = 0;
  size_t total_bytes = 0;
  size_t free_bytes = 0;
};

// Whether a device answers; where not, why, in words.
TRACEFLOW_WITH_CUDA bool answers(std::string& why_not);
TRACEFLOW_WITH_CUDA DeviceFacts facts();
// From a pool that keeps what is given back, so that a program in its stride asks the driver for nothing.
TRACEFLOW_WITH_CUDA void* allocate(size_t bytes);
TRACEFLOW_WITH_CUDA void release(void* memory) noexcept;
TRACEFLOW_WITH_CUDA void copy(Device to_device, void* to, Device from_device, const void* from, size_t bytes);
TRACEFLOW_WITH_CUDA void zero(void* memory, size_t bytes);
// Waits for all work. Throws InternalError with the device's message where some of it failed.
TRACEFLOW_WITH_CUDA void synchronise();

}  // namespace traceflow::cuda
