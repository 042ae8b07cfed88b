#pragma once

#include <optional>

#include "capture/lens/lens.h"
#include "files/file_tree.h"
#include "files/npy.h"
#include "math/types.h"

namespace traceflow {

// Where a view's pixels come from and how they are processed. Files are false if the capture lacks them.
struct ViewSource {
  TreeFile image, mask, prior, depth, truth_normal, truth_depth;
  bool mask_is_inverted = false;  // NeRF-DS's resized_mask: black = object
  int64_t prior_slice = -1;       // element of the capture's array of priors; −1 if there is no array
  Lens lens;                      // of the stored image
  double zoom = 1;                // of the undistorted image (capture/lens/lens.h)
  int factor = 1;                 // a pixel of the view covers factor × factor stored pixels
  Mat3<double> camera_from_world{1};
  uint8_t background = 0;               // grey level behind transparent pixels
  bool transparent_is_unknown = false;  // transparent pixels are not part of the photograph
  std::string rig_camera;               // the camera of a rig that took the view; empty: unknown

  int64_t width() const { return static_cast<int64_t>(lens.width) / factor; }
  int64_t height() const { return static_cast<int64_t>(lens.height) / factor; }
  bool has_prior() const { return prior || prior_slice >= 0; }
};

// Data shared by all views of a capture.
struct CaptureSource {
  std::optional<NpyFile> prior_array;      // T×H×W×3
  Vec3<double> prior_signs{1, -1, -1};     // the priors' axes relative to OpenCV's
  double scale = 1;                        // scene units per capture unit
  TreeFile motion_points, motion_objects;  // true motion of moving objects
};

}  // namespace traceflow
