#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace traceflow {

struct ZipEntry {
  std::string name;  // ASCII
  std::string bytes;
};

// Writes a zip archive with the entries as they are, not deflated, atomically. The same entries give the same
// bytes: all dates are 1 January 1980. Less than 4 GiB and 65,536 entries.
void write_zip(const std::filesystem::path& path, const std::vector<ZipEntry>& entries);

}  // namespace traceflow
