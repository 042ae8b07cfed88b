#pragma once

#include <cstddef>
#include <cstdint>
#include <new>
#include <string>

#include "base/device.h"

// Memory on a device, and facts about the device. All work on the CUDA device runs on one stream, in the
// order of the calls. A copy to the host waits for it.
namespace traceflow::memory {

// A device ran out of memory: bytes requested (0: by the driver) and bytes available.
class OutOfMemory : public std::bad_alloc {
 public:
  OutOfMemory(size_t wanted, size_t available);
  const char* what() const noexcept override { return text_.c_str(); }

 private:
  std::string text_;
};

// Allocates `bytes` on the device, aligned to at least 64 bytes. Throws OutOfMemory.
void* allocate(Device device, size_t bytes);
void release(Device device, void* memory, size_t bytes) noexcept;
// Copies between any two devices. The host waits if it reads.
void copy(Device to_device, void* to, Device from_device, const void* from, size_t bytes);
void zero(Device device, void* memory, size_t bytes);
// Waits for all work on the device; does nothing for the CPU.
void synchronise(Device device);

// Bytes allocated on the CUDA device now, and the maximum so far.
size_t device_bytes();
size_t most_device_bytes();
// Number of allocations there so far.
int64_t device_allocations();
// The most bytes that may be allocated there; allocations beyond throw OutOfMemory. Initially only the device
// limits them.
void set_device_budget(size_t bytes);

}  // namespace traceflow::memory

namespace traceflow::cuda {

// Whether steps on the CUDA device sum in the same order in every run where that costs time. Initially off.
bool deterministic();
void set_deterministic(bool on);

}  // namespace traceflow::cuda

// The CUDA implementation of the above, defined in programs built with CUDA (device_cuda.cu) or with the
// tests' emulation; null elsewhere.
namespace traceflow::cuda {

struct DeviceFacts {
  std::string name;  // as reported by the driver
  int major = 0, minor = 0;
  size_t total_bytes = 0;
  size_t free_bytes = 0;
};

// Whether a device responds; if not, why_not gives the reason in words.
TRACEFLOW_WITH_CUDA bool answers(std::string& why_not);
TRACEFLOW_WITH_CUDA DeviceFacts facts();
// Allocates from a pool that keeps freed memory, so that a program in steady state asks the driver for
// nothing.
TRACEFLOW_WITH_CUDA void* allocate(size_t bytes);
TRACEFLOW_WITH_CUDA void release(void* memory) noexcept;
TRACEFLOW_WITH_CUDA void copy(Device to_device, void* to, Device from_device, const void* from, size_t bytes);
TRACEFLOW_WITH_CUDA void zero(void* memory, size_t bytes);
// Waits for all work. Throws InternalError with the device's message if any of it failed.
TRACEFLOW_WITH_CUDA void synchronise();

}  // namespace traceflow::cuda
