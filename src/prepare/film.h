#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <vector>

#include "base/tensor.h"

namespace traceflow::prepare {

// A video, or one image, as ffmpeg decodes it: rotated by its metadata, with square pixels.
struct Film {
  std::filesystem::path path;
  int longest_side = 0;  // larger images are scaled down to this; 0: not scaled
  bool grey = false;
  bool is_still = false;  // one image, whatever its name looks like
};

// Passes every image, H×W×3 or (grey) H×W×1, to `take` in display order until it returns false. Returns the
// times in seconds of the images taken. Throws InputError for what ffmpeg cannot read, and Stopped. ffmpeg's
// output goes to `log`.
std::vector<double> decode_film(const Film& film, const std::filesystem::path& log,
                                const std::atomic<bool>& stop,
                                const std::function<bool(int64_t index, Tensor<uint8_t>&& picture)>& take);

// The first image.
Tensor<uint8_t> decode_picture(const Film& film, const std::filesystem::path& log,
                               const std::atomic<bool>& stop);

}  // namespace traceflow::prepare
