#include "capture/formats/capture_options.h"

namespace traceflow {

void CaptureOptions::validate() const {
  check_option(downscale >= 1 && downscale <= 64, "downscale", downscale, "1 to 64");
  check_option(test_every == 0 || (test_every >= 2 && test_every <= 1000000), "test_every", test_every,
               "0 or 2 to 1000000");
  check_option(cache_mebibytes >= 0 && cache_mebibytes <= (int64_t{1} << 30), "cache_mebibytes",
               cache_mebibytes, "0 to 2^30");
}

}  // namespace traceflow
