#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "base/error.h"

namespace traceflow {

// A file that is there and that the system does not let us read, so that nothing is known of what it holds.
class UnreadableFile : public InputError {
 public:
  UnreadableFile(const std::filesystem::path& path, const std::string& reason)
      : InputError(path.string(), "", reason, "a readable file") {}
};

// A file opened for reading at any place, by several threads at once. Every failure is an InputError naming
// the file; those of the system, but that there is none, an UnreadableFile.
class InputFile {
 public:
  explicit InputFile(const std::filesystem::path& path);
  // The file at `path`, which errors call `name`.
  InputFile(const std::filesystem::path& path, std::filesystem::path name);
  // A nameless file in the machine's temporary folder, gone when closed; errors name `origin`.
  static InputFile scratch(const std::filesystem::path& origin);
  // `size` bytes of this file from `offset`, which it must have, as a file of their own called `name`.
  InputFile part(int64_t offset, int64_t size, std::filesystem::path name) const;
  // The same file under another name in errors.
  InputFile renamed(std::filesystem::path name) &&;
  ~InputFile();
  InputFile(InputFile&& other) noexcept;
  InputFile& operator=(InputFile&& other) noexcept;
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;

  const std::filesystem::path& path() const { return path_; }
  int64_t size() const { return size_; }
  // Fills `bytes` from `offset`. Throws when the file ends before.
  void read_at(int64_t offset, std::span<std::byte> bytes) const;
  // Only for scratch files: grows the file.
  void append(std::span<const std::byte> bytes);

 private:
  // What was opened for reading; -1 where errno says why it could not be.
  InputFile(std::filesystem::path path, int descriptor);
  InputFile(std::filesystem::path path, int descriptor, int64_t size);
  void close() noexcept;

  std::filesystem::path path_;
  int descriptor_ = -1;
  int64_t begin_ = 0;  // in what the descriptor opens
  int64_t size_ = 0;
};

}  // namespace traceflow
