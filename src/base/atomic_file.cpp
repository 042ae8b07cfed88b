#include "base/atomic_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <string>
#include <system_error>

#include "base/error.h"

namespace traceflow {

namespace {

[[noreturn]] void fail(const std::filesystem::path& path, const char* step) {
  throw InputError(path.string(), step, std::system_category().message(errno), "a writable file",
                   "check space and permissions");
}

// Closes the descriptor and removes the temporary file unless the write was completed.
struct TemporaryFile {
  std::string name;
  int descriptor = -1;
  bool renamed = false;

  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  explicit TemporaryFile(const std::filesystem::path& path) : name(path.string() + ".partial") {
    descriptor = ::open(name.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    if (descriptor < 0) fail(path, "open");
  }
  ~TemporaryFile() {
    if (descriptor >= 0) ::close(descriptor);
    if (!renamed) ::unlink(name.c_str());
  }
};

void write_all(int descriptor, std::span<const std::byte> bytes, const std::filesystem::path& path) {
  for (size_t written = 0; written < bytes.size();) {
    const ssize_t n = ::write(descriptor, bytes.data() + written, bytes.size() - written);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail(path, "write");
    written += static_cast<size_t>(n);
  }
}

}  // namespace

void write_atomically(const std::filesystem::path& path,
                      const std::vector<std::span<const std::byte>>& parts) {
  TemporaryFile file(path);
  for (const std::span<const std::byte> part : parts) write_all(file.descriptor, part, path);
  if (::fsync(file.descriptor) != 0) fail(path, "sync");
  if (::rename(file.name.c_str(), path.c_str()) != 0) fail(path, "rename");
  file.renamed = true;
  sync_folder(path.parent_path());
}

void write_atomically(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  write_atomically(path, std::vector{bytes});
}

void write_atomically(const std::filesystem::path& path, std::string_view text) {
  write_atomically(path, std::as_bytes(std::span(text.data(), text.size())));
}

void sync_folder(const std::filesystem::path& folder) {
  const int descriptor = ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  ::fsync(descriptor);
  ::close(descriptor);
}

}  // namespace traceflow
