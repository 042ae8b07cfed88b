#include "emulation/device.h"

#include <sanitizer/asan_interface.h>
#include <sys/mman.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <map>

#include "base/device_memory.h"
#include "base/error.h"
#include "emulation/grid.h"

namespace traceflow::emulation {

namespace {

class Region {
 public:
  Region() {
    // Every kernel opens and closes all that is used, which takes as long as there are pages.
    void* const memory = mmap(nullptr, region_bytes + huge_page, PROT_NONE,
                              MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    require(memory != MAP_FAILED, "the emulated device has memory");
    const auto address = reinterpret_cast<uintptr_t>(memory);
    begin_ = static_cast<std::byte*>(memory) + (huge_page - address % huge_page) % huge_page;
    madvise(begin_, region_bytes, MADV_HUGEPAGE);
  }

  // First fit.
  void* allocate(size_t bytes) {
    const size_t size = (std::max<size_t>(bytes, 1) + page - 1) / page * page;
    if (allocated_ + size > limit_) throw memory::OutOfMemory(bytes, limit_ - std::min(limit_, allocated_));
    size_t place = 0;
    for (const auto& [begin, length] : blocks_) {
      if (begin - place >= size) break;
      place = begin + length;
    }
    require(place + size <= region_bytes, "the emulated device's region holds what its limit allows");
    blocks_[place] = size;
    allocated_ += size;
    const DeviceAccess access;
    grow(place + size);
    ASAN_UNPOISON_MEMORY_REGION(begin_ + place, size);
    std::memset(begin_ + place, 0xff, size);
    ASAN_POISON_MEMORY_REGION(begin_ + place + bytes, size - bytes);
    return begin_ + place;
  }
  void release(void* memory) {
    const auto found = blocks_.find(static_cast<size_t>(static_cast<std::byte*>(memory) - begin_));
    require(found != blocks_.end(), "memory is given back once");
    allocated_ -= found->second;
    ASAN_POISON_MEMORY_REGION(memory, found->second);
    blocks_.erase(found);
  }
  void open() {
    if (++depth_ == 1) protect(PROT_READ | PROT_WRITE);
  }
  void close() {
    if (--depth_ == 0) protect(PROT_NONE);
  }
  bool holds(const void* address) const { return address >= begin_ && address < begin_ + used_; }
  size_t allocated() const { return allocated_; }
  void limit(size_t limit) { limit_ = limit; }

 private:
  static constexpr size_t region_bytes = size_t{4} << 30;
  static constexpr size_t page = 4096, huge_page = size_t{2} << 20;

  // Under the address sanitizer a kernel that leaves its tensors is found at once: what is not allocated is
  // poisoned.
  void grow(size_t end) {
    const size_t used = std::max(used_, (end + huge_page - 1) / huge_page * huge_page);
    ASAN_POISON_MEMORY_REGION(begin_ + used_, used - used_);
    used_ = used;
    protect(PROT_READ | PROT_WRITE);
  }
  void protect(int access) {
    if (used_ > 0)
      require(mprotect(begin_, used_, access) == 0, "the emulated device's memory opens and closes");
  }

  std::byte* begin_ = nullptr;
  std::map<size_t, size_t> blocks_;  // place → size
  size_t used_ = 0, allocated_ = 0, limit_ = region_bytes;
  int depth_ = 0;
};

// Kernels come from one thread, as on a device all are put on one stream.
int64_t started = 0, refuse_from = 0, refusals_left = 0, trimmed = 0;

Region& region() {
  static Region* const the_region = new Region;  // outlives every static tensor
  return *the_region;
}

}  // namespace

DeviceAccess::DeviceAccess() { region().open(); }
DeviceAccess::~DeviceAccess() { region().close(); }

bool on_device(const void* address) { return region().holds(address); }
size_t allocated_bytes() { return region().allocated(); }
void limit_bytes(size_t limit) { region().limit(limit); }

int64_t launches() { return started; }
void refuse_launches(int64_t after, int64_t times) {
  refuse_from = started + after;
  refusals_left = times;
}
int64_t trims() { return trimmed; }

bool launch(const char* kernel, unsigned blocks, unsigned threads, const std::function<void()>& thread) {
  if (refusals_left > 0 && started >= refuse_from) {
    --refusals_left;
    return false;
  }
  ++started;
  const DeviceAccess access;
  run_grid(kernel, {blocks, 1, 1}, {threads, 1, 1}, thread);
  return true;
}

}  // namespace traceflow::emulation

namespace traceflow::cuda {

bool answers(std::string&) { return true; }
DeviceFacts facts() {
  return {"emulation", 0, 0, size_t{4} << 30, (size_t{4} << 30) - emulation::allocated_bytes()};
}
void* allocate(size_t bytes) { return bytes == 0 ? nullptr : emulation::region().allocate(bytes); }
void release(void* memory) noexcept { emulation::region().release(memory); }
void copy(Device, void* to, Device, const void* from, size_t bytes) {
  const emulation::DeviceAccess access;
  std::memcpy(to, from, bytes);
}
void zero(void* memory, size_t bytes) {
  const emulation::DeviceAccess access;
  std::memset(memory, 0, bytes);
}
void synchronise() {}
void trim_pool() { ++emulation::trimmed; }

}  // namespace traceflow::cuda
