#pragma once

#include "base/tensor.h"
#include "capture/capture.h"
#include "capture/view_source.h"

// From a view's files to pixels on the view's grid: straightened where the lens is not a pinhole, filtered to
// its size.
namespace traceflow {

struct DecodedColour {
  Tensor<uint8_t> colour;  // H×W×3
  Tensor<uint8_t> known;   // H×W of 0 and 1; empty where all is known
};
DecodedColour decode_colour(const ViewSource& view);
struct DecodedMask {
  Tensor<uint8_t> mask;      // H×W of 0 and 1: whether it covers half of a pixel
  Tensor<uint8_t> coverage;  // H×W, 255 where it covers all of one
};
DecodedMask decode_mask(const ViewSource& view);
// H×W×3 in the prior's own axes, unit, zero where there is none.
Tensor<float> decode_prior(const ViewSource& view, const CaptureSource& capture);
ViewTruth decode_truth(const ViewSource& view, const CaptureSource& capture);

// The normals 2v − 1 of a picture H×W×C (C ≥ 3) with values v, zero where it says "none": H×W×3, not yet
// unit. Throws InputError naming the picture where it has too few channels.
Tensor<float> normals_of_picture(const Tensor<uint16_t>& picture, const std::string& name);

// Turns unit or zero normals from the prior's axes to world.
void turn_to_world(Tensor<float>& normals, const ViewSource& view, const Vec3<double>& signs);

}  // namespace traceflow
