#include "base/folder_lock.h"

#include <fcntl.h>
#include <sys/file.h>
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
  if (errno == ELOOP) throw InputError(path.string(), "", "a link", "the lock of a folder", "remove it");
  throw InputError(path.string(), "", std::generic_category().message(errno), "a writable folder",
                   "check permissions, or choose another folder");
}

std::string name_of_host() {
  std::array<char, 100> host{};
  ::gethostname(host.data(), host.size() - 1);
  return host.data();
}

std::string name_of_process(pid_t id) { return "process " + std::to_string(id) + " on " + name_of_host(); }

// Whether `name` is that of a process on this machine that has ended.
bool has_ended(const std::string& name) {
  const std::string before = "process ";
  if (!name.starts_with(before)) return false;
  const pid_t id = std::atoi(name.c_str() + before.size());
  return id > 0 && name == name_of_process(id) && ::kill(id, 0) != 0 && errno == ESRCH;
}

// The holder's name, as written in the lock file. If that process has ended, the holder is a program that it
// started.
std::string holder(int descriptor) {
  std::array<char, 200> text{};
  const ssize_t size = ::pread(descriptor, text.data(), text.size(), 0);
  std::string who(text.data(), static_cast<size_t>(std::max<ssize_t>(0, size)));
  for (char& c : who) c = c < ' ' || c > '~' ? ' ' : c;
  while (!who.empty() && who.back() == ' ') who.pop_back();
  if (who.empty()) return "another process";
  return has_ended(who) ? "a program that outlived " + who : who;
}

}  // namespace

FolderLock::FolderLock(const std::filesystem::path& file, const std::filesystem::path& folder,
                       const std::string& work)
    : file_(file) {
  do {
    // Child processes inherit the descriptor (there is no O_CLOEXEC). If this process is killed, the lock
    // therefore remains until its children, which may still write, have ended. PR_SET_PDEATHSIG would end
    // only direct children, not the processes that a script starts. O_NOFOLLOW: the lock file is written to,
    // and a link may lead to anybody's file.
    lock_ = Descriptor(::open(file_.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW, 0644));
    if (!lock_) fail(file_);
    keeps_others_out_ = ::flock(lock_.number(), LOCK_EX | LOCK_NB) == 0;
    // Any other error means that the file system has no locks.
    if (!keeps_others_out_ && errno == EWOULDBLOCK) {
      throw InputError(folder.string(), "", holder(lock_.number()) + " " + work + " in it",
                       "a folder of its own", "wait for that process or stop it, or choose another folder");
    }
  } while (!lock_.is_named(file_));
  const std::string who = name_of_process(::getpid()) + "\n";
  // If the name cannot be written, only a message lacks it.
  if (::ftruncate(lock_.number(), 0) != 0 || ::pwrite(lock_.number(), who.data(), who.size(), 0) < 0) return;
}

FolderLock::~FolderLock() {
  if (lock_.is_named(file_)) ::unlink(file_.c_str());
}

}  // namespace traceflow
