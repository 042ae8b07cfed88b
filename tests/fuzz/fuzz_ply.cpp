// Bytes as a .ply of surfels.
#include <cstring>

#include "fuzz/scratch_file.h"
#include "splat/ply.h"
#include "support/file_bytes.h"

using namespace traceflow;
using fuzz::promise;

namespace {

void check(const Surfels& s, size_t file_bytes) {
  const int64_t n = s.position.dim(0), k = s.sh.dim(1);
  promise(s.position.shape() == Shape{n, 3} && s.log_scale.shape() == Shape{n, 2} &&
              s.rotation.shape() == Shape{n, 4} && s.opacity_logit.shape() == Shape{n} &&
              s.sh.shape() == Shape{n, k, 3},
          "every surfel has everything");
  promise(k == 1 || k == 4 || k == 9 || k == 16, "harmonics are of a degree");
  promise(s.tint_logit.empty() || s.tint_logit.shape() == Shape{n}, "every surfel has a tint or none has");
  promise(s.roughness_logit.empty() || s.roughness_logit.shape() == Shape{n},
          "every surfel has a roughness or none has");
  promise(n * (10 + 3 * k) <= static_cast<int64_t>(file_bytes), "no more surfels than the file can hold");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const fuzz::ScratchFolder folder;
  const auto path = folder.write("a.ply", fuzz::text_of(data, size));
  PlyScene scene;
  if (!fuzz::accepts(path.string(), [&] { scene = read_ply(path); })) return 0;
  check(scene.surfels, size);
  const auto again = folder.path() / "b.ply";
  write_ply(again, scene);
  const PlyScene read = read_ply(again);
  promise(read.notes == scene.notes, "notes are kept");
  const std::string bytes = bytes_of(again);
  write_ply(again, read);
  promise(bytes_of(again) == bytes, "what is written reads back");
  return 0;
}
