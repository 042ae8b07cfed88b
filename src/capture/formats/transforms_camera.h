#pragma once

#include <optional>
#include <string>

#include "capture/lens/lens.h"
#include "files/json_document.h"

// Cameras as transforms.json has them.
namespace traceflow {

// Fields that a file gives for all frames and any frame for itself; those that nobody gives follow from the
// image.
struct TransformsLens {
  std::optional<double> width, height, focal_x, focal_y, centre_x, centre_y, angle_x, angle_y;
  double skew = 0;
  double k1 = 0, k2 = 0, k3 = 0, k4 = 0, p1 = 0, p2 = 0;
  bool is_fisheye = false;
  bool rolling_shutter = false;  // taken from more than one pose

  // Takes what `field` gives. Throws InputError for values that make no camera, and for models that no Lens
  // can be, by name.
  void take(const JsonField& field);
  // For an image of this size, where the file gives none. Throws InputError naming `field` where there is no
  // focal length.
  Lens lens(double image_width, double image_height, const JsonField& field) const;
};

struct TransformsPose {
  Mat3<double> camera_from_world{1};  // camera axes x right, y down, z forward
  Vec3<double> position{0};
};

// From "transform_matrix": world_from_camera, the camera's axes x right, y up, z backward. A scale common to
// all axes is taken out. Throws InputError.
TransformsPose read_transform_matrix(const JsonField& field);

}  // namespace traceflow
