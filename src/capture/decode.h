#pragma once

#include "base/tensor.h"
#include "capture/capture.h"
#include "capture/view_source.h"

// Decodes a view's files to pixels on the view's grid: undistorted if the lens is not a pinhole, and filtered
// to the view's size.
namespace traceflow {

struct DecodedColour {
  Tensor<uint8_t> colour;  // H×W×3
  Tensor<uint8_t> known;   // H×W of 0 and 1; empty if all pixels are known
};
DecodedColour decode_colour(const ViewSource& view);
struct DecodedMask {
  Tensor<uint8_t> mask;      // H×W of 0 and 1: 1 if the mask covers at least half of the pixel
  Tensor<uint8_t> coverage;  // H×W, 255 if the mask covers the whole pixel
};
DecodedMask decode_mask(const ViewSource& view);
// Width and height of a file of depths. Throws InputError unless it is H×W or H×W×1 and no larger than
// images.
Vec2<double> depth_size(const TreeFile& file);
// H×W×3 in the prior's own axes, unit or zero (no prior).
Tensor<float> decode_prior(const ViewSource& view, const CaptureSource& capture);
// H×W, camera z in scene units, 0 if unknown. The view has a depth prior.
Tensor<float> decode_depth(const ViewSource& view, const CaptureSource& capture);
ViewTruth decode_truth(const ViewSource& view, const CaptureSource& capture);

// The normals 2v − 1 of an image H×W×C (C ≥ 3) with values v; zero if the colour means "none". H×W×3, not
// normalised. Throws InputError with the image's name if it has too few channels.
Tensor<float> normals_of_picture(const Tensor<uint16_t>& picture, const std::string& name);

// Rotates unit or zero normals from the prior's axes to world axes.
void turn_to_world(Tensor<float>& normals, const ViewSource& view, const Vec3<double>& signs);

}  // namespace traceflow
