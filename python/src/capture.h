#pragma once

#include <memory>
#include <string>

#include "capture/capture.h"

namespace traceflow::python {

// A capture as Python holds it.
struct HeldCapture {
  Capture capture;
  CaptureOptions options;  // that it was read with
};

// A view of a capture, which it keeps alive.
struct HeldView {
  std::shared_ptr<const HeldCapture> capture;
  const View* view;
  const char* split;
  // Arrays of one view share its pixels while one of them is in use.
  mutable std::weak_ptr<const ViewImages> images = {};
  mutable std::weak_ptr<const ViewTruth> truth = {};
};

}  // namespace traceflow::python
