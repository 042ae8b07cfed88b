#pragma once

#include <string>
#include <vector>

#include "capture/formats/found_capture.h"

namespace traceflow {

// Paths of images that the capture does not name, in the folders of the views' images or of other cameras of
// their rig. A name that extends a named one ("r_0_depth_0001.png" and r_0) counts as part of it. Hidden
// files, such as those of macOS ("._a.jpg"), are ignored.
std::vector<std::string> unregistered_images(const FileTree& tree, const FoundCapture& found);

}  // namespace traceflow
