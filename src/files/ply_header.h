#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "files/input_file.h"

namespace traceflow {

// The format's scalar types.
enum class PlyScalar { i8, u8, i16, u16, i32, u32, f32, f64 };

// One number of every row.
struct PlyProperty {
  std::string name;
  PlyScalar type;
  int64_t offset;  // bytes from the start of the row
};

struct PlyHeader {
  int64_t rows = 0;  // vertices
  int64_t row_bytes = 0;
  int64_t bytes = 0;  // of the header itself; the rows follow
  std::vector<PlyProperty> properties;
  std::map<std::string, std::string> notes;  // from lines "comment traceflow KEY VALUE"

  // Null if there is no property with this name.
  const PlyProperty* find(const std::string& name) const;
};

// Advice for a .ply that cannot be used.
inline constexpr const char* ply_remedy = "write it with 2DGS or `traceflow export`";

// Reads the header strictly: binary little endian, vertices first, scalar properties, no unknown lines,
// limits on everything, and all rows within the file. Throws InputError otherwise.
PlyHeader read_ply_header(const InputFile& file);

}  // namespace traceflow
