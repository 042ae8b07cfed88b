#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <map>
#include <mutex>
#include <new>

#include "emulation/grid.h"

// Where the host's tensors lie. They are what asks for aligned memory (base/device_memory.cpp), so that this
// program's own operators for it keep the list.
namespace traceflow::emulation {

namespace {

class HostTensors {
 public:
  void add(const void* memory, size_t bytes) {
    const std::lock_guard lock(mutex_);
    bytes_[reinterpret_cast<uintptr_t>(memory)] = bytes;
  }
  void remove(const void* memory) {
    const std::lock_guard lock(mutex_);
    bytes_.erase(reinterpret_cast<uintptr_t>(memory));
  }
  bool hold(uintptr_t address) {
    const std::lock_guard lock(mutex_);
    const auto after = bytes_.upper_bound(address);
    if (after == bytes_.begin()) return false;
    const auto& [begin, bytes] = *std::prev(after);
    return address - begin < bytes;
  }

 private:
  std::mutex mutex_;
  std::map<uintptr_t, size_t> bytes_;
};

HostTensors& host_tensors() {
  static HostTensors* const all = new HostTensors;  // outlives every static tensor
  return *all;
}

}  // namespace

void require_no_host_tensors(const char* kernel, const void* argument, size_t bytes) {
  const auto* const begin = static_cast<const std::byte*>(argument);
  for (size_t at = 0; at + sizeof(uintptr_t) <= bytes; at += sizeof(uintptr_t)) {
    uintptr_t word = 0;
    std::memcpy(&word, begin + at, sizeof(word));
    if (!host_tensors().hold(word)) continue;
    std::fprintf(stderr, "emulation: %s: the kernel is given a tensor on the host\n", kernel);
    std::abort();
  }
}

}  // namespace traceflow::emulation

void* operator new(size_t bytes, std::align_val_t alignment) {
  const auto step = static_cast<size_t>(alignment);
  void* const memory = std::aligned_alloc(step, (bytes + step) / step * step);
  if (memory == nullptr && bytes > 0) throw std::bad_alloc();
  traceflow::emulation::host_tensors().add(memory, bytes);
  return memory;
}
void operator delete(void* memory, std::align_val_t) noexcept {
  traceflow::emulation::host_tensors().remove(memory);
  std::free(memory);
}
void operator delete(void* memory, size_t, std::align_val_t alignment) noexcept {
  operator delete(memory, alignment);
}
