#include "files/zip_writer.h"

#include <zlib.h>

#include <cstdint>

#include "base/atomic_file.h"
#include "base/error.h"

namespace traceflow {

namespace {

constexpr uint32_t written_local = 0x04034b50, written_directory = 0x02014b50, written_end = 0x06054b50;
constexpr uint32_t needed_version = 20, first_of_1980 = 1 << 5 | 1;

void append(std::string& to, uint32_t value, int width) {
  for (int i = 0; i < width; ++i) to.push_back(static_cast<char>(value >> 8 * i & 0xff));
}

// What the entry's header and its directory record have in common.
std::string common_fields(const ZipEntry& entry) {
  const auto size = static_cast<uint32_t>(entry.bytes.size());
  const auto checksum = static_cast<uint32_t>(
      crc32_z(0, reinterpret_cast<const Bytef*>(entry.bytes.data()), entry.bytes.size()));
  std::string fields;
  append(fields, needed_version, 2);
  append(fields, 0, 2);  // flags
  append(fields, 0, 2);  // stored
  append(fields, 0, 2);  // midnight
  append(fields, first_of_1980, 2);
  append(fields, checksum, 4);
  append(fields, size, 4);  // stored
  append(fields, size, 4);  // unpacked
  append(fields, static_cast<uint32_t>(entry.name.size()), 2);
  append(fields, 0, 2);  // extra fields
  return fields;
}

}  // namespace

void write_zip(const std::filesystem::path& path, const std::vector<ZipEntry>& entries) {
  std::string archive, directory;
  for (const ZipEntry& entry : entries) {
    require(archive.size() + entry.bytes.size() < UINT32_MAX, "a zip archive of less than 4 GiB", entry.name);
    const std::string fields = common_fields(entry);
    append(directory, written_directory, 4);
    append(directory, needed_version, 2);
    directory += fields;
    append(directory, 0, 2);  // comment
    append(directory, 0, 2);  // disk
    append(directory, 0, 2);  // internal attributes
    append(directory, 0, 4);  // external attributes
    append(directory, static_cast<uint32_t>(archive.size()), 4);
    directory += entry.name;
    append(archive, written_local, 4);
    archive += fields + entry.name + entry.bytes;
  }
  require(entries.size() < UINT16_MAX && archive.size() + directory.size() < UINT32_MAX,
          "a zip archive of less than 4 GiB and 65,535 entries", path.string());
  const auto begin = static_cast<uint32_t>(archive.size()), size = static_cast<uint32_t>(directory.size());
  archive += directory;
  append(archive, written_end, 4);
  append(archive, 0, 2);  // this disk
  append(archive, 0, 2);  // the directory's disk
  for (int i = 0; i < 2; ++i) append(archive, static_cast<uint32_t>(entries.size()), 2);
  append(archive, size, 4);
  append(archive, begin, 4);
  append(archive, 0, 2);  // comment
  write_atomically(path, archive);
}

}  // namespace traceflow
