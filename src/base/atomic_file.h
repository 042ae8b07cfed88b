#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/descriptor.h"

namespace traceflow {

// Writes bytes under a temporary name in the same folder, syncs file and folder, and renames. Readers see the
// old file or a new one, never a part, also when several processes write at once. Throws InputError with the
// path and the reason when writing fails.
void write_atomically(const std::filesystem::path& path, std::span<const std::byte> bytes);
void write_atomically(const std::filesystem::path& path, std::string_view text);
// The same for bytes in several places, in order.
void write_atomically(const std::filesystem::path& path,
                      const std::vector<std::span<const std::byte>>& parts);

// A file that is written under a temporary name, empty at first, until put_in_place(). While this object
// exists no other PartialFile writes that name. A file that a killed program left under it is overwritten.
class PartialFile {
 public:
  enum class OtherWriter { awaited, refused };

  // ending: of the temporary name. Throws InputError with `path`, like all members.
  explicit PartialFile(std::filesystem::path path, OtherWriter other = OtherWriter::awaited,
                       const std::string& ending = ".partial");
  // Removes the file unless put_in_place() succeeded.
  ~PartialFile();
  PartialFile(const PartialFile&) = delete;
  PartialFile& operator=(const PartialFile&) = delete;

  // The temporary path.
  const std::filesystem::path& name() const { return name_; }
  void write(std::span<const std::byte> bytes);
  // Waits until all bytes are on the disk, also those that others wrote, and renames the file to its path.
  void put_in_place();

 private:
  std::filesystem::path path_, name_;
  Descriptor file_;
  bool in_place_ = false;
};

// Waits until files created or renamed in a folder are on the disk. Throws InputError if they may be lost.
// Does nothing on file systems that cannot sync folders.
void sync_folder(const std::filesystem::path& folder);

// Creates a folder and its missing parents, and syncs them. Throws InputError.
void make_folder(const std::filesystem::path& folder);

}  // namespace traceflow
