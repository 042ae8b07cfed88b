#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/tensor.h"
#include "files/npy.h"
#include "prepare/picture_source.h"

namespace traceflow::prepare {

// Depths of many views from another program, in its own units: an array T×H×W (.npz, .npy), a folder with one
// array H×W for each view, or a video or folder of grey images.
class DepthSource {
 public:
  // Of an .npz it takes the array `depths` or `depth`, or the only one. Throws InputError.
  DepthSource(const std::filesystem::path& path, const std::filesystem::path& log,
              const std::atomic<bool>& stop);

  int64_t count() const { return count_; }
  // Of a folder's files; empty for others.
  std::vector<std::string> names() const;
  // Reads the given ascending indices. `take` gets the position in `indices` and H×W values, NaN where there
  // is none.
  void take(const std::vector<int64_t>& indices,
            const std::function<void(int64_t place, Tensor<float>&& values)>& take) const;

 private:
  Tensor<float> read(int64_t index) const;

  std::optional<NpyFile> array_;
  std::optional<PictureSource> video_;
  std::vector<std::filesystem::path> files_;
  int64_t count_ = 0;
};

}  // namespace traceflow::prepare
