#pragma once

#include <optional>

#include "capture/lens/lens.h"
#include "files/file_tree.h"
#include "files/npy.h"
#include "math/types.h"

namespace traceflow {

// Where a view's pixels come from and what has to be done to them. Files are false where the capture lacks
// them.
struct ViewSource {
  TreeFile image, mask, prior, truth_normal, truth_depth;
  bool mask_is_inverted = false;  // NeRF-DS's resized_mask: black = object
  int64_t prior_slice = -1;       // element of the capture's prior array, where there is one instead of files
  Lens lens;                      // over the stored image
  double zoom = 1;                // of the straightened image (capture/lens/lens.h)
  int factor = 1;                 // pixels of the stored image a side that make one of the view's
  Mat3<double> camera_from_world{1};
  uint8_t background = 0;               // grey level behind transparent pixels
  bool transparent_is_unknown = false;  // they are no part of the photograph
  std::string rig_camera;               // which of a rig's cameras took it; empty: not known

  int64_t width() const { return static_cast<int64_t>(lens.width) / factor; }
  int64_t height() const { return static_cast<int64_t>(lens.height) / factor; }
  bool has_prior() const { return prior || prior_slice >= 0; }
};

// What all views of a capture share.
struct CaptureSource {
  std::optional<NpyFile> prior_array;      // T×H×W×3
  Vec3<double> prior_signs{1, -1, -1};     // the priors' axes against OpenCV's
  double scale = 1;                        // scene units per capture unit
  TreeFile motion_points, motion_objects;  // truth of what moves
};

}  // namespace traceflow
