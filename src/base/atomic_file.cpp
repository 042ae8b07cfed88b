#include "base/atomic_file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <utility>

#include "base/error.h"

namespace traceflow {

namespace {

constexpr size_t longest_name = 255;  // bytes of a file name

[[noreturn]] void fail(const std::filesystem::path& path, const char* step) {
  throw InputError(path.string(), step, std::system_category().message(errno), "a writable file",
                   "check space and permissions");
}

std::filesystem::path beside(const std::filesystem::path& path, const std::string& ending) {
  return path.parent_path() / (path.filename().string().substr(0, longest_name - ending.size()) + ending);
}

// Waits until no other process holds the lock. Returns at once on file systems without locks.
void hold(const Descriptor& file, const std::filesystem::path& path, PartialFile::OtherWriter other) {
  const int how = other == PartialFile::OtherWriter::refused ? LOCK_EX | LOCK_NB : LOCK_EX;
  while (::flock(file.number(), how) != 0) {
    if (errno == EINTR) continue;
    if (errno != EWOULDBLOCK) return;
    throw InputError(path.string(), "", "another program that writes it", "a file of its own",
                     "wait for that program or stop it, or choose another name");
  }
}

// Errors of syncing a folder where the file system has no such operation, or where the user lacks permission.
bool means_no_sync(int error) {
  return error == EINVAL || error == ENOTSUP || error == ENOSYS || error == EBADF || error == EACCES;
}

}  // namespace

PartialFile::PartialFile(std::filesystem::path path, OtherWriter other, const std::string& ending)
    : path_(std::move(path)), name_(beside(path_, ending)) {
  // The process that held the lock before may have renamed the file meanwhile.
  do {
    file_ = Descriptor(::open(name_.c_str(), O_WRONLY | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0644));
    if (!file_) fail(path_, "open");
    hold(file_, path_, other);
  } while (!file_.is_named(name_));
  if (::ftruncate(file_.number(), 0) != 0) fail(path_, "open");
}

PartialFile::~PartialFile() {
  if (!in_place_) ::unlink(name_.c_str());
}

void PartialFile::write(std::span<const std::byte> bytes) {
  for (size_t written = 0; written < bytes.size();) {
    const ssize_t n = ::write(file_.number(), bytes.data() + written, bytes.size() - written);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail(path_, "write");
    written += static_cast<size_t>(n);
  }
}

void PartialFile::put_in_place() {
  if (::fsync(file_.number()) != 0) fail(path_, "sync");
  if (::rename(name_.c_str(), path_.c_str()) != 0) fail(path_, "rename");
  in_place_ = true;
  sync_folder(path_.parent_path());
}

void write_atomically(const std::filesystem::path& path,
                      const std::vector<std::span<const std::byte>>& parts) {
  PartialFile file(path);
  for (const std::span<const std::byte> part : parts) file.write(part);
  file.put_in_place();
}

void write_atomically(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  write_atomically(path, std::vector{bytes});
}

void write_atomically(const std::filesystem::path& path, std::string_view text) {
  write_atomically(path, std::as_bytes(std::span(text.data(), text.size())));
}

void sync_folder(const std::filesystem::path& folder) {
  const Descriptor opened(::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (opened && ::fsync(opened.number()) == 0) return;
  if (!means_no_sync(errno)) fail(folder, "sync");
}

void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  if (folder.empty() || std::filesystem::is_directory(folder, error)) return;
  make_folder(folder.parent_path());
  const bool made = std::filesystem::create_directory(folder, error);
  if (error) {
    throw InputError(folder.string(), "", error.message(), "a writable folder",
                     "check space and permissions, or choose another folder");
  }
  if (made) sync_folder(folder.parent_path());
}

}  // namespace traceflow
