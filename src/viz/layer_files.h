#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "viz/picture.h"

namespace traceflow::viz {

enum class ImageFormat { png, npy };

// Writes a frame's layers as FOLDER/LAYER/NAME.png for viewing, or as .npy (float32, H×W or H×W×3) for other
// programs.
class LayerFiles {
 public:
  // scale: scene units per unit of the capture, for depths.
  LayerFiles(std::filesystem::path folder, std::vector<Layer> layers, ImageFormat format, double scale)
      : folder_(std::move(folder)), layers_(std::move(layers)), format_(format), scale_(scale) {}

  // name may contain folders, which are created. tracks: for the layer `tracks`.
  void write(const std::string& name, const Frame& frame, const Tracks& tracks = {});

 private:
  std::filesystem::path folder_;
  std::vector<Layer> layers_;
  ImageFormat format_;
  double scale_;
  Painter painter_;
};

}  // namespace traceflow::viz
