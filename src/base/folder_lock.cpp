#include "base/folder_lock.h"

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

FolderLock::FolderLock(const std::filesystem::path& file, const std::filesystem::path& folder,
                       const std::string& work)
    : file_(file) {
  while (descriptor_ < 0) {
    const int opened = ::open(file_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    if (opened < 0) fail(file_);
    // A file system that knows no locks has none to refuse.
    if (::flock(opened, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
      const std::string who = holder(opened);
      ::close(opened);
      throw InputError(folder.string(), "", who + " " + work + " in it", "a folder of its own",
                       "wait for that process or stop it, or choose another folder");
    }
    if (leads_to(file_, opened)) {
      descriptor_ = opened;
    } else {
      ::close(opened);
    }
  }
  const std::string who = myself();
  // A name that cannot be written is only missed in a message.
  if (::ftruncate(descriptor_, 0) != 0 || ::pwrite(descriptor_, who.data(), who.size(), 0) < 0) return;
}

FolderLock::~FolderLock() {
  if (leads_to(file_, descriptor_)) ::unlink(file_.c_str());
  ::close(descriptor_);
}

}  // namespace traceflow
