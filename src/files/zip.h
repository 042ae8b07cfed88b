#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "files/input_file.h"

// The little of the zip format that .npz files use: members stored or deflated, zip64 sizes, no encryption.
namespace traceflow {

struct ZipMember {
  std::string name = {};
  bool deflated = false;
  int64_t offset = 0;  // of the member's data in the file
  int64_t stored_size = 0;
  int64_t size = 0;
  uint32_t checksum = 0;  // CRC-32 of what it holds
};

// Throws InputError for what is not a zip, uses other features, points outside the file, has members on top
// of one another, or promises more of one than its bytes can hold.
std::vector<ZipMember> list_zip(const InputFile& file);

// Unpacks a deflated member into a scratch file, in pieces, so that memory does not grow with its size.
// Throws InputError where the temporary folder has no room for it, and for what is not what the directory
// says.
InputFile inflate_to_scratch(const InputFile& file, const ZipMember& member);

}  // namespace traceflow
