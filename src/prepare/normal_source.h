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

// Normals of many views from another program, in its own axes: an array T×H×W×3 (.npz, .npy), or a video or
// folder of images whose values 0 … 1 mean 2v − 1.
class NormalSource {
 public:
  // Throws InputError.
  NormalSource(const std::filesystem::path& path, const std::filesystem::path& log,
               const std::atomic<bool>& stop);

  int64_t count() const { return count_; }
  // Of a folder's images; empty for others.
  std::vector<std::string> names() const;
  // Reads the given ascending indices. `take` gets the position in `indices` and H×W×3 vectors of any length,
  // zero if there is no normal.
  void take(const std::vector<int64_t>& indices,
            const std::function<void(int64_t place, Tensor<float>&& normals)>& take) const;

 private:
  std::optional<NpyFile> array_;
  std::optional<PictureSource> pictures_;
  std::filesystem::path folder_;  // of images that this program decodes itself, to keep all bits
  int64_t count_ = 0;
};

// 16 bits of v = (n + 1) / 2 of unit vectors; black if there is no normal.
Tensor<uint16_t> normal_picture(const Tensor<float>& normals);

}  // namespace traceflow::prepare
