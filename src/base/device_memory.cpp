#include "base/device_memory.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <limits>

#include "base/error.h"
#include "base/profile.h"

namespace traceflow::memory {

namespace {

constexpr std::align_val_t alignment{64};

// What is allocated on the CUDA device.
struct Account {
  std::atomic<size_t> bytes = 0, most = 0;
  std::atomic<int64_t> allocations = 0;
  std::atomic<size_t> budget = std::numeric_limits<size_t>::max();

  void take(size_t wanted) {
    const size_t now = bytes += wanted;
    if (now > budget) {
      bytes -= wanted;
      throw OutOfMemory(wanted, budget - std::min<size_t>(budget, now - wanted));
    }
    ++allocations;
    size_t before = most;
    while (now > before && !most.compare_exchange_weak(before, now)) {
    }
  }
};
Account account;

}  // namespace

OutOfMemory::OutOfMemory(size_t wanted, size_t available)
    : text_("out of device memory: " +
            (wanted > 0 ? std::to_string(wanted >> 20) + " MiB wanted" : "the driver found none for itself") +
            ", " + std::to_string(available >> 20) + " MiB free") {}

void* allocate(Device device, size_t bytes) {
  if (device == Device::cpu) return ::operator new(bytes, alignment);
  require(cuda::allocate != nullptr, "tensors are put on the CUDA device by programs built with CUDA");
  account.take(bytes);
  try {
    return cuda::allocate(bytes);
  } catch (...) {
    account.bytes -= bytes;
    throw;
  }
}

void release(Device device, void* memory, size_t bytes) noexcept {
  if (memory == nullptr) return;
  if (device == Device::cpu) {
    ::operator delete(memory, alignment);
  } else {
    cuda::release(memory);
    account.bytes -= bytes;
  }
}

void copy(Device to_device, void* to, Device from_device, const void* from, size_t bytes) {
  if (bytes == 0) return;
  if (to_device == Device::cpu && from_device == Device::cpu) {
    std::memcpy(to, from, bytes);
  } else {
    const profile::Scope scope(to_device == Device::cpu     ? "device: read by the host"
                               : from_device == Device::cpu ? "device: written by the host"
                                                            : "device: copy");
    cuda::copy(to_device, to, from_device, from, bytes);
    if (profile::is_on()) cuda::synchronise();
  }
}

void zero(Device device, void* memory, size_t bytes) {
  if (bytes == 0) return;
  if (device == Device::cpu) {
    std::memset(memory, 0, bytes);
  } else {
    const profile::Scope scope("device: zeros");
    cuda::zero(memory, bytes);
    if (profile::is_on()) cuda::synchronise();
  }
}

void synchronise(Device device) {
  if (device == Device::cuda) cuda::synchronise();
}

size_t device_bytes() { return account.bytes; }
size_t most_device_bytes() { return account.most; }
int64_t device_allocations() { return account.allocations; }
void set_device_budget(size_t bytes) { account.budget = bytes; }

}  // namespace traceflow::memory

namespace traceflow::cuda {

namespace {

std::atomic<bool> always_the_same = false;

}  // namespace

bool deterministic() { return always_the_same; }
void set_deterministic(bool on) { always_the_same = on; }

}  // namespace traceflow::cuda
