#pragma once

#include <string>
#include <vector>

#include "capture/formats/found_capture.h"

namespace traceflow {

// Paths of images that lie beside those of the views, or in the folders of other cameras of their rig, and
// that the capture does not name. One called like a named one with something behind ("r_0_depth_0001.png" to
// r_0) counts as belonging to it. Hidden files, which a Mac adds ("._a.jpg"), are none.
std::vector<std::string> unregistered_images(const FileTree& tree, const FoundCapture& found);

}  // namespace traceflow
