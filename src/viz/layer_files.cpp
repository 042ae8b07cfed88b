#include "viz/layer_files.h"

#include "base/parallel.h"
#include "files/npy.h"
#include "files/png.h"

namespace traceflow::viz {

void LayerFiles::write(const std::string& name, const Frame& frame, const Tracks& tracks) {
  std::vector<Tensor<float>> values(layers_.size());
  std::vector<Tensor<uint8_t>> pictures(layers_.size());
  std::vector<std::filesystem::path> paths(layers_.size());
  for (size_t i = 0; i < layers_.size(); ++i) {
    values[i] = layer_values(frame, layers_[i], scale_, tracks);
    // In order, since the painter keeps the first frame's ranges.
    if (format_ == ImageFormat::png) pictures[i] = painter_.paint(layers_[i], values[i]);
    paths[i] = folder_ / to_string(layers_[i]) / (name + (format_ == ImageFormat::png ? ".png" : ".npy"));
    std::filesystem::create_directories(paths[i].parent_path());
  }
  parallel_for(
      "show: write layers", static_cast<int64_t>(layers_.size()),
      [&](int64_t i) {
        const auto k = static_cast<size_t>(i);
        if (format_ == ImageFormat::png) {
          write_png(paths[k], pictures[k]);
        } else {
          write_npy(paths[k], values[k]);
        }
      },
      1);
}

}  // namespace traceflow::viz
