#include "files/input_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <cerrno>
#include <cstdlib>
#include <string>
#include <system_error>
#include <utility>

#include "base/error.h"

namespace traceflow {

namespace {

// The message of the last failed system call.
std::string reason() { return std::generic_category().message(errno); }

// O_NONBLOCK: opening a pipe must not wait for a writer.
constexpr int to_read = O_RDONLY | O_CLOEXEC | O_NONBLOCK;

}  // namespace

InputFile::InputFile(const std::filesystem::path& path) : InputFile(path, path) {}

InputFile::InputFile(const std::filesystem::path& path, std::filesystem::path name)
    : InputFile(std::move(name), Descriptor(::open(path.c_str(), to_read))) {}

InputFile::InputFile(std::filesystem::path path, Descriptor descriptor)
    : path_(std::move(path)), descriptor_(std::move(descriptor)) {
  if (!descriptor_ && errno == ENOENT) throw InputError(path_.string(), "", reason(), "a readable file");
  if (!descriptor_) throw UnreadableFile(path_, reason());
  struct stat status {};
  if (::fstat(descriptor_.number(), &status) != 0 || !S_ISREG(status.st_mode))
    throw InputError(path_.string(), "", "something that is not a regular file", "a readable file");
  size_ = status.st_size;
}

InputFile::InputFile(std::filesystem::path path, Descriptor descriptor, int64_t size)
    : path_(std::move(path)), descriptor_(std::move(descriptor)), size_(size) {}

InputFile InputFile::scratch(const std::filesystem::path& origin) {
  std::string name = (std::filesystem::temp_directory_path() / "traceflow-XXXXXX").string();
  Descriptor descriptor(::mkostemp(name.data(), O_CLOEXEC));
  if (!descriptor) {
    throw InputError(origin.string(), "temporary file " + name, reason(), "room to unpack",
                     "set TMPDIR to a folder with space");
  }
  ::unlink(name.c_str());
  return {origin, std::move(descriptor), 0};
}

InputFile InputFile::part(int64_t offset, int64_t size, std::filesystem::path name) const {
  require(offset >= 0 && size >= 0 && offset <= size_ && size <= size_ - offset, "a part lies in its file",
          path_.string());
  Descriptor descriptor(::fcntl(descriptor_.number(), F_DUPFD_CLOEXEC, 0));
  if (!descriptor) throw UnreadableFile(name, reason());
  InputFile result(std::move(name), std::move(descriptor), size);
  result.begin_ = begin_ + offset;
  return result;
}

InputFile InputFile::renamed(std::filesystem::path name) && {
  path_ = std::move(name);
  return std::move(*this);
}

void InputFile::read_at(int64_t offset, std::span<std::byte> bytes) const {
  const auto wanted = static_cast<int64_t>(bytes.size());
  const auto cut_short = [&] {
    throw InputError(path_.string(), "", std::to_string(size_) + " bytes",
                     std::to_string(offset + wanted) + " bytes at least",
                     "the file is cut short; copy it again");
  };
  if (offset < 0 || offset > size_ || wanted > size_ - offset) cut_short();
  for (size_t done = 0; done < bytes.size();) {
    const ssize_t n = ::pread(descriptor_.number(), bytes.data() + done, bytes.size() - done,
                              static_cast<off_t>(begin_ + offset) + static_cast<off_t>(done));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw UnreadableFile(path_, reason());
    if (n == 0) cut_short();
    done += static_cast<size_t>(n);
  }
}

void InputFile::append(std::span<const std::byte> bytes) {
  for (size_t done = 0; done < bytes.size();) {
    const ssize_t n =
        ::pwrite(descriptor_.number(), bytes.data() + done, bytes.size() - done, static_cast<off_t>(size_));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) {
      throw InputError(path_.string(), "unpacking", reason(), "room in the temporary folder",
                       "set TMPDIR to a folder with space");
    }
    done += static_cast<size_t>(n);
    size_ += n;
  }
}

}  // namespace traceflow
