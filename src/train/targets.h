#pragma once

#include <memory>
#include <string>
#include <unordered_map>

#include "capture/pixels.h"

namespace traceflow {

// The photographs that training compares with, on the scene's device.
class Targets {
 public:
  // On the CUDA device the first views stay resident up to the limit, in the capture's compact format. Views
  // come in random order, so replacing one by another would save nothing.
  Targets(Device device, int64_t limit_bytes) : device_(device), limit_bytes_(limit_bytes) {}

  // Valid until the next call. with_coverage: also the coverage by the masks.
  ViewImages& of(const Capture& capture, const View& view, bool with_coverage);

 private:
  const ViewPixels& on_device(const Capture& capture, const View& view);

  Device device_;
  int64_t limit_bytes_;
  std::unordered_map<std::string, ViewPixels> resident_;
  int64_t resident_bytes_ = 0;
  ViewPixels passing_;
  ViewImages images_;
};

}  // namespace traceflow
