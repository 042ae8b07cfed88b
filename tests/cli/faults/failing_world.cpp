// Memory and clocks that fail inside the program, in place of the system's own.
#include <dlfcn.h>
#include <execinfo.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <new>

#include "cli/faults/world.h"

namespace {

std::atomic<bool> armed{false};
std::atomic<int64_t> allocations{0};
std::atomic<bool> has_failed{false};
int64_t first_failing = 0;
bool all_from_there = false;
bool clock_jumps = false;

int64_t number(const char* name) {
  const char* text = std::getenv(name);  // NOLINT(concurrency-mt-unsafe): before there are threads
  return text == nullptr ? 0 : std::atoll(text);
}

// oneDNN ends the program itself where its own requests for memory are refused: they are not.
bool is_for_onednn() {
  std::array<void*, 64> frames{};
  const int count = ::backtrace(frames.data(), static_cast<int>(frames.size()));
  return std::any_of(frames.begin(), frames.begin() + count, [](void* address) {
    Dl_info info{};
    return ::dladdr(address, &info) != 0 && info.dli_fname != nullptr &&
           std::strstr(info.dli_fname, "libdnnl") != nullptr;
  });
}

bool fails() {
  if (!armed.load(std::memory_order_relaxed)) return false;
  const int64_t n = ++allocations;
  if (n < first_failing || has_failed.load(std::memory_order_relaxed) || is_for_onednn()) return false;
  if (!all_from_there) has_failed = true;
  return true;
}

void* taken(std::size_t size, std::size_t alignment) {
  if (fails()) return nullptr;
  size = std::max<std::size_t>(size, 1);
  if (alignment <= __STDCPP_DEFAULT_NEW_ALIGNMENT__) return std::malloc(size);
  return std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
}

void* taken_or_thrown(std::size_t size, std::size_t alignment) {
  void* const memory = taken(size, alignment);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

void say_allocations() { std::fprintf(stderr, "allocations: %lld\n", static_cast<long long>(allocations)); }

// Forth by years, back by more, and forth again.
std::time_t jump() {
  static std::atomic<int> look{0};
  constexpr std::time_t year = 365 * 86400;
  constexpr std::time_t jumps[] = {0, 9 * year, -20 * year, 3 * year, -1, -45 * year};
  return clock_jumps ? jumps[look++ % 6] : 0;
}

}  // namespace

namespace traceflow::faults {

void arm() {
  clock_jumps = number("FAULTS_CLOCK") != 0;
  const char* const disk = std::getenv("FAULTS_DISK");  // NOLINT(concurrency-mt-unsafe): as above
  if (disk != nullptr) arm_disk(DiskFault::from_text(disk));
  const int64_t n = number("FAULTS_ALLOCATION");
  if (n == 0) return;
  first_failing = n == count_only ? INT64_MAX : n;
  all_from_there = number("FAULTS_FROM_THERE") != 0;
  if (n == count_only) std::atexit(say_allocations);
  std::array<void*, 1> frame{};
  ::backtrace(frame.data(), 1);  // which loads what it needs the first time
  armed = true;
}

NoMemory::NoMemory() {
  has_failed = false;
  first_failing = 0;
  all_from_there = true;
  armed = true;
}
NoMemory::~NoMemory() { armed = false; }

RefusedOnce::RefusedOnce(int64_t n) {
  allocations = 0;
  has_failed = false;
  first_failing = n;
  all_from_there = false;
  armed = true;
}
RefusedOnce::~RefusedOnce() { armed = false; }

}  // namespace traceflow::faults

void* operator new(std::size_t size) { return taken_or_thrown(size, 0); }
void* operator new[](std::size_t size) { return taken_or_thrown(size, 0); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  return taken_or_thrown(size, static_cast<std::size_t>(alignment));
}
void* operator new[](std::size_t size, std::align_val_t alignment) {
  return taken_or_thrown(size, static_cast<std::size_t>(alignment));
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept { return taken(size, 0); }
void* operator new[](std::size_t size, const std::nothrow_t&) noexcept { return taken(size, 0); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, const std::nothrow_t&) noexcept { std::free(memory); }
void operator delete[](void* memory, const std::nothrow_t&) noexcept { std::free(memory); }

extern "C" {

// Read by the leak sanitizer. nlohmann-json's constructor from a list gives up the object that it was
// filling where the next request is refused; the program ends there.
// NOLINTNEXTLINE(bugprone-reserved-identifier,readability-identifier-naming)
const char* __lsan_default_suppressions() { return "leak:nlohmann::"; }

// The C library's names of parameters are none that we may use.
// NOLINTBEGIN(readability-inconsistent-declaration-parameter-name)
int clock_gettime(clockid_t clock, timespec* time) noexcept {
  const long result = ::syscall(SYS_clock_gettime, clock, time);
  if (result == 0 && clock == CLOCK_REALTIME) time->tv_sec += jump();
  return static_cast<int>(result);
}

std::time_t time(std::time_t* into) noexcept {
  timespec now{};
  ::clock_gettime(CLOCK_REALTIME, &now);
  if (into != nullptr) *into = now.tv_sec;
  return now.tv_sec;
}

int gettimeofday(timeval* into, void*) noexcept {
  timespec now{};
  ::clock_gettime(CLOCK_REALTIME, &now);
  *into = {now.tv_sec, now.tv_nsec / 1000};
  return 0;
}
// NOLINTEND(readability-inconsistent-declaration-parameter-name)

}  // extern "C"
