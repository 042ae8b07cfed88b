#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "files/input_file.h"

// The subset of the zip format that .npz files use: members stored or deflated, zip64 sizes, no encryption.
namespace traceflow {

struct ZipMember {
  std::string name = {};
  bool deflated = false;
  int64_t offset = 0;  // of the member's data in the file
  int64_t stored_size = 0;
  int64_t size = 0;
  uint32_t checksum = 0;  // CRC-32 of the unpacked data
};

// Lists the members. Throws InputError for what is not a zip, uses other features, points outside the file,
// has overlapping members, or promises a larger member than its bytes can hold.
std::vector<ZipMember> list_zip(const InputFile& file);

// Unpacks a deflated member into a scratch file, in pieces, so that memory does not grow with its size.
// Throws InputError if the temporary folder has no room for it, and for data that do not match the directory.
InputFile inflate_to_scratch(const InputFile& file, const ZipMember& member);

}  // namespace traceflow
