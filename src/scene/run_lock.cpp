#include "scene/run_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <string>
#include <system_error>

#include "base/error.h"

namespace traceflow {

namespace {

[[noreturn]] void fail(const std::filesystem::path& path) {
  throw InputError(path.string(), "", std::generic_category().message(errno), "a writable folder",
                   "check permissions, or choose another folder");
}

// What the holder wrote: who it is.
std::string holder(int descriptor) {
  std::array<char, 200> text{};
  const ssize_t size = ::pread(descriptor, text.data(), text.size(), 0);
  std::string who(text.data(), static_cast<size_t>(std::max<ssize_t>(0, size)));
  for (char& c : who) c = c < ' ' || c > '~' ? ' ' : c;
  while (!who.empty() && who.back() == ' ') who.pop_back();
  return who.empty() ? "another process" : who;
}

std::string myself() {
  std::array<char, 100> host{};
  ::gethostname(host.data(), host.size() - 1);
  return "process " + std::to_string(::getpid()) + " on " + host.data() + "\n";
}

// Whether the path still leads to this file: whoever held it before may have removed it meanwhile.
bool leads_to(const std::filesystem::path& path, int descriptor) {
  struct stat named {
  }, open{};
  return ::stat(path.c_str(), &named) == 0 && ::fstat(descriptor, &open) == 0 &&
         named.st_ino == open.st_ino && named.st_dev == open.st_dev;
}

}  // namespace

RunLock::RunLock(const RunFolder& run) : path_(run.lock()) {
  while (descriptor_ < 0) {
    const int file = ::open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    if (file < 0) fail(path_);
    // A file system that knows no locks has none to refuse.
    if (::flock(file, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
      const std::string who = holder(file);
      ::close(file);
      throw InputError(run.folder.string(), "", who + " training in it", "a folder of its own",
                       "wait for that training or stop it, or choose another folder");
    }
    if (leads_to(path_, file)) {
      descriptor_ = file;
    } else {
      ::close(file);
    }
  }
  const std::string who = myself();
  // A name that cannot be written is only missed in a message.
  if (::ftruncate(descriptor_, 0) != 0 || ::pwrite(descriptor_, who.data(), who.size(), 0) < 0) return;
}

RunLock::~RunLock() {
  if (leads_to(path_, descriptor_)) ::unlink(path_.c_str());
  ::close(descriptor_);
}

}  // namespace traceflow
