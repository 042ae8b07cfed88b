// Bytes as an .spz.
#include "splat/spz.h"

#include <cmath>

#include "fuzz/scratch_file.h"
#include "support/file_bytes.h"

using namespace traceflow;
using fuzz::promise;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const fuzz::ScratchFolder folder;
  const auto path = folder.write("a.spz", fuzz::text_of(data, size));
  Surfels s;
  if (!fuzz::accepts(path.string(), [&] { s = read_spz(path); })) return 0;
  const int64_t n = s.position.dim(0), k = s.sh.dim(1);
  promise(s.position.shape() == Shape{n, 3} && s.log_scale.shape() == Shape{n, 2} &&
              s.rotation.shape() == Shape{n, 4} && s.opacity_logit.shape() == Shape{n} &&
              s.sh.shape() == Shape{n, k, 3} && !s.has_tint() && !s.has_roughness(),
          "every surfel has everything but a tint and a roughness");
  promise(k == 1 || k == 4 || k == 9 || k == 16, "harmonics are of a degree");
  s.for_each([](const std::string&, const Tensor<float>& t) {
    for (const float v : t.values()) promise(std::isfinite(v), "numbers are finite");
  });
  const auto again = folder.path() / "b.spz";
  write_spz(again, s);
  promise(read_spz(again).position.shape() == s.position.shape(), "what is written reads back");
  return 0;
}
