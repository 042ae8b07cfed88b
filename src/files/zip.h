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
};

// Throws InputError for what is not a zip, uses other features, or points outside the file.
std::vector<ZipMember> list_zip(const InputFile& file);

// Unpacks a deflated member into a scratch file, in pieces, so that memory does not grow with its size.
InputFile inflate_to_scratch(const InputFile& file, const ZipMember& member);

}  // namespace traceflow
