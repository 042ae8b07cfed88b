#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/descriptor.h"

namespace traceflow {

// Writes bytes under a temporary name in the same folder, syncs file and folder, and renames: readers see the
// old file or a new one, never a part, however many write at once. Throws InputError naming the path and the
// reason when the disk refuses.
void write_atomically(const std::filesystem::path& path, std::span<const std::byte> bytes);
void write_atomically(const std::filesystem::path& path, std::string_view text);
// The same of bytes that lie in several places, in order.
void write_atomically(const std::filesystem::path& path,
                      const std::vector<std::span<const std::byte>>& parts);

// A file under its temporary name, empty at first, until it is put in its place. As long as this stands no
// other one writes it; what a program that was killed has left there is written over.
class PartialFile {
 public:
  enum class OtherWriter { awaited, refused };

  // ending: of the temporary name. Throws InputError naming `path`, as all here do.
  explicit PartialFile(std::filesystem::path path, OtherWriter other = OtherWriter::awaited,
                       const std::string& ending = ".partial");
  // Removes it, unless it was put in its place.
  ~PartialFile();
  PartialFile(const PartialFile&) = delete;
  PartialFile& operator=(const PartialFile&) = delete;

  // Where it lies now.
  const std::filesystem::path& name() const { return name_; }
  void write(std::span<const std::byte> bytes);
  // Waits until it is on the disk, whoever has written it, and gives it its own name.
  void put_in_place();

 private:
  std::filesystem::path path_, name_;
  Descriptor file_;
  bool in_place_ = false;
};

// Waits until what was made or renamed in a folder is on the disk. Throws InputError where it may be lost;
// file systems that sync no folders are taken as they are.
void sync_folder(const std::filesystem::path& folder);

// Makes a folder and those above it that are missing, so that they last. Throws InputError.
void make_folder(const std::filesystem::path& folder);

}  // namespace traceflow
