// A disk that refuses, in place of the system's own calls.
#include <fcntl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <mutex>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cli/faults/world.h"

namespace {

using traceflow::faults::DiskFault;

std::atomic<bool> is_watched{false};
std::mutex one_at_a_time;
DiskFault disk_fault;
int64_t disk_calls = 0;
bool is_full = false;  // since the last write found room for its half
std::vector<std::string> noted;

std::string path_of(int descriptor) {
  std::array<char, 4096> path{};
  const std::string link = "/proc/self/fd/" + std::to_string(descriptor);
  const ssize_t size = ::readlink(link.c_str(), path.data(), path.size());
  return {path.data(), static_cast<size_t>(std::max<ssize_t>(0, size))};
}

std::string name_of(const std::string& path) { return std::filesystem::path(path).filename(); }

bool concerns(const std::string& path) { return path.find(disk_fault.file) != std::string::npos; }

bool refuses(std::string_view call, const std::string& names) {
  noted.push_back(std::string(call) + " " + names);
  if (!disk_fault.call.empty() && disk_fault.call != call) return false;
  const int64_t n = ++disk_calls;
  return disk_fault.first > 0 && n >= disk_fault.first && n - disk_fault.first < disk_fault.count;
}

// How much of a write the disk takes. As the system has it, what does not fit is refused at the next call.
size_t room_for(int descriptor, size_t size) {
  if (!is_watched) return size;
  const std::lock_guard lock(one_at_a_time);
  const std::string path = path_of(descriptor);
  if (!concerns(path)) return size;
  if (std::exchange(is_full, false)) return 0;
  if (!refuses("write", name_of(path))) return size;
  is_full = size > 1;
  return size / 2;
}

bool takes(std::string_view call, const std::string& path, const std::string& names) {
  if (!is_watched) return true;
  const std::lock_guard lock(one_at_a_time);
  return !concerns(path) || !refuses(call, names);
}

int failed(int error) {
  errno = error;
  return -1;
}

void say_disk_calls() {
  std::fprintf(stderr, "calls to the disk: %lld\n", static_cast<long long>(disk_calls));
}

}  // namespace

namespace traceflow::faults {

std::string DiskFault::to_text() const {
  std::ostringstream text;
  text << first << ' ' << count << ' ' << file << ' ' << call;
  return text.str();
}

DiskFault DiskFault::from_text(const std::string& text) {
  DiskFault fault;
  std::istringstream(text) >> fault.first >> fault.count >> fault.file >> fault.call;
  return fault;
}

void arm_disk(const DiskFault& fault) {
  disk_fault = fault;
  disk_calls = 0;
  is_full = false;
  noted.clear();
  if (fault.first == count_only) std::atexit(say_disk_calls);
  is_watched = !fault.file.empty();
}

WatchedDisk::WatchedDisk(const DiskFault& fault) { arm_disk(fault); }
WatchedDisk::~WatchedDisk() { is_watched = false; }
std::vector<std::string> WatchedDisk::calls() { return noted; }

}  // namespace traceflow::faults

extern "C" {

// The C library's names of parameters are none that we may use.
// NOLINTBEGIN(readability-inconsistent-declaration-parameter-name)
ssize_t write(int descriptor, const void* bytes, size_t size) {
  const size_t room = room_for(descriptor, size);
  if (room == 0 && size > 0) return failed(ENOSPC);
  return ::syscall(SYS_write, descriptor, bytes, room);
}

int fsync(int descriptor) {
  const std::string path = is_watched ? path_of(descriptor) : "";
  if (!takes("fsync", path, name_of(path))) return failed(EIO);
  return static_cast<int>(::syscall(SYS_fsync, descriptor));
}

int flock(int descriptor, int operation) noexcept {
  // Asked for by name alone: others count the calls that write.
  if (is_watched && disk_fault.call == "flock") {
    const std::string path = path_of(descriptor);
    if (!takes("flock", path, name_of(path))) return failed(ENOLCK);
  }
  return static_cast<int>(::syscall(SYS_flock, descriptor, operation));
}

int rename(const char* from, const char* to) noexcept {
  if (!takes("rename", from, name_of(from) + " " + name_of(to))) return failed(EIO);
  return ::renameat(AT_FDCWD, from, AT_FDCWD, to);
}
// NOLINTEND(readability-inconsistent-declaration-parameter-name)

}  // extern "C"
