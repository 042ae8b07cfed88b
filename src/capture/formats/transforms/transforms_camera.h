#pragma once

#include <optional>
#include <string>

#include "capture/lens/lens.h"
#include "files/json_document.h"

// Cameras of transforms.json.
namespace traceflow {

// Fields that a file may define for all frames and each frame for itself. Undefined ones follow from the
// image.
struct TransformsLens {
  std::optional<double> width, height, focal_x, focal_y, centre_x, centre_y, angle_x, angle_y;
  double skew = 0;
  double k1 = 0, k2 = 0, k3 = 0, k4 = 0, p1 = 0, p2 = 0;
  bool is_fisheye = false;
  bool rolling_shutter = false;  // the frame has more than one pose

  // Reads the fields in `field`. Throws InputError for invalid values, and with the name for models that Lens
  // cannot represent.
  void take(const JsonField& field);
  // The lens for an image of this size, if the file gives no size. Throws InputError with `field` if there is
  // no focal length.
  Lens lens(double image_width, double image_height, const JsonField& field) const;
};

struct TransformsPose {
  Mat3<double> camera_from_world{1};  // camera axes x right, y down, z forward
  Vec3<double> position{0};
};

// From "transform_matrix": world_from_camera, camera axes x right, y up, z backward. A scale common to all
// axes is removed. Throws InputError.
TransformsPose read_transform_matrix(const JsonField& field);

}  // namespace traceflow
