#include "base/folder_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <string>
#include <system_error>

#include "base/error.h"

namespace traceflow {

namespace {

[[noreturn]] void fail(const std::filesystem::path& path) {
  throw InputError(path.string(), "", std::generic_category().message(errno), "a writable folder",
                   "check permissions, or choose another folder");
}

std::string name_of_host() {
  std::array<char, 100> host{};
  ::gethostname(host.data(), host.size() - 1);
  return host.data();
}

std::string name_of_process(pid_t id) { return "process " + std::to_string(id) + " on " + name_of_host(); }

// Whether a name is that of a process of this machine that has ended.
bool has_ended(const std::string& name) {
  const std::string before = "process ";
  if (!name.starts_with(before)) return false;
  const pid_t id = std::atoi(name.c_str() + before.size());
  return id > 0 && name == name_of_process(id) && ::kill(id, 0) != 0 && errno == ESRCH;
}

// What the holder wrote: who it is. Where that has ended, it is a program that it had started.
std::string holder(int descriptor) {
  std::array<char, 200> text{};
  const ssize_t size = ::pread(descriptor, text.data(), text.size(), 0);
  std::string who(text.data(), static_cast<size_t>(std::max<ssize_t>(0, size)));
  for (char& c : who) c = c < ' ' || c > '~' ? ' ' : c;
  while (!who.empty() && who.back() == ' ') who.pop_back();
  if (who.empty()) return "another process";
  return has_ended(who) ? "a program that outlived " + who : who;
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
    // Programs that are started inherit it (there is no O_CLOEXEC): where this one is killed, the lock stands
    // until they end, and with them what they still write. That they end with their parent
    // (PR_SET_PDEATHSIG) could be asked of the first of them alone, not of what a script then starts.
    const int opened = ::open(file_.c_str(), O_RDWR | O_CREAT, 0644);
    if (opened < 0) fail(file_);
    keeps_others_out_ = ::flock(opened, LOCK_EX | LOCK_NB) == 0;
    // Any other error is that of a file system which knows no locks.
    if (!keeps_others_out_ && errno == EWOULDBLOCK) {
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
  const std::string who = name_of_process(::getpid()) + "\n";
  // A name that cannot be written is only missed in a message.
  if (::ftruncate(descriptor_, 0) != 0 || ::pwrite(descriptor_, who.data(), who.size(), 0) < 0) return;
}

FolderLock::~FolderLock() {
  if (leads_to(file_, descriptor_)) ::unlink(file_.c_str());
  ::close(descriptor_);
}

}  // namespace traceflow
