#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "base/descriptor.h"
#include "base/error.h"

namespace traceflow {

// A file that exists but that the system does not let us read, so that its content is unknown.
class UnreadableFile : public InputError {
 public:
  UnreadableFile(const std::filesystem::path& path, const std::string& reason)
      : InputError(path.string(), "", reason, "a readable file") {}
};

// A file opened for reading at any offset, by several threads at once. Every failure is an InputError with
// the file's name. Errors of the system are UnreadableFile, except that the file does not exist.
class InputFile {
 public:
  explicit InputFile(const std::filesystem::path& path);
  // Opens the file at `path`; errors call it `name`.
  InputFile(const std::filesystem::path& path, std::filesystem::path name);
  // A nameless temporary file that disappears when closed; errors name `origin`.
  static InputFile scratch(const std::filesystem::path& origin);
  // The `size` bytes from `offset`, which must exist, as a file of their own with this name.
  InputFile part(int64_t offset, int64_t size, std::filesystem::path name) const;
  // The same file under another name in errors.
  InputFile renamed(std::filesystem::path name) &&;

  const std::filesystem::path& path() const { return path_; }
  int64_t size() const { return size_; }
  // Fills `bytes` from `offset`. Throws if the file is too short.
  void read_at(int64_t offset, std::span<std::byte> bytes) const;
  // Grows the file; only for scratch files.
  void append(std::span<const std::byte> bytes);

 private:
  // Takes a descriptor opened for reading; if there is none, errno has the reason.
  InputFile(std::filesystem::path path, Descriptor descriptor);
  InputFile(std::filesystem::path path, Descriptor descriptor, int64_t size);

  std::filesystem::path path_;
  Descriptor descriptor_;
  int64_t begin_ = 0;  // offset in the descriptor's file
  int64_t size_ = 0;
};

}  // namespace traceflow
