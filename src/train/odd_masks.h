#pragma once

#include <string>
#include <vector>

#include "capture/capture.h"

// Masks that those of the times beside them contradict.
namespace traceflow {

// What a view's mask covers.
struct MaskExtent {
  std::string id;
  double share = 0;           // of the image
  bool touches_edge = false;  // of the image, or nearly: what it shows may be leaving the picture
};
// Of extents in the order of time, the places of those that are odd: blank, or 1.7 times smaller or larger
// than the median of the three before and the three after that are not blank. A small one is not odd where
// what it shows may be leaving the picture: where it, or the next one on either side that is not blank and
// small as well, touches the image's edge.
std::vector<size_t> odd_extents(const std::vector<MaskExtent>& extents);

// Takes odd masks away from training views, each camera's by themselves: a view without a mask tells nothing
// of silhouettes, one with a wrong mask misleads. Adds a warning that names them.
void leave_out_odd_masks(Capture& capture);

}  // namespace traceflow
