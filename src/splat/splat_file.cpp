#include "splat/splat_file.h"

#include "splat/spz.h"

namespace traceflow {

PlyScene read_splat_file(const std::filesystem::path& path) {
  if (is_spz(path)) return {read_spz(path), {}, PlyVertex::gaussian};
  return read_ply(path);
}

}  // namespace traceflow
