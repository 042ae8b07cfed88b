#pragma once

#include "capture/lens/lens.h"
#include "files/input_file.h"

namespace traceflow {

// camera/ID.json as stored: lengths in the capture's units, pixels of image_size.
struct CapturedCamera {
  Lens lens;
  Mat3<double> camera_from_world{1};
  Vec3<double> position{0};
};

// Throws InputError for missing or invalid fields.
CapturedCamera read_nerfies_camera(const InputFile& input);

}  // namespace traceflow
