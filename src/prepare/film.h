#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <vector>

#include "base/tensor.h"

namespace traceflow::prepare {

// A film, or one picture, as ffmpeg decodes it: turned as its metadata say, with square pixels.
struct Film {
  std::filesystem::path path;
  int longest_side = 0;  // larger pictures are scaled down to this; 0: as they are
  bool grey = false;
  bool is_still = false;  // one picture, whatever its name looks like
};

// Hands every picture, H×W×3 or (grey) H×W×1, to `take` in the order shown, until that is false. The
// pictures' times in seconds, of as many as were taken. Throws InputError for what ffmpeg cannot read, and
// Stopped. What ffmpeg says goes to `log`.
std::vector<double> decode_film(const Film& film, const std::filesystem::path& log,
                                const std::atomic<bool>& stop,
                                const std::function<bool(int64_t index, Tensor<uint8_t>&& picture)>& take);

// The first picture.
Tensor<uint8_t> decode_picture(const Film& film, const std::filesystem::path& log,
                               const std::atomic<bool>& stop);

}  // namespace traceflow::prepare
