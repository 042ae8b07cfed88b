#pragma once

#include <string>
#include <vector>

#include "capture/capture.h"

// Ignores masks that contradict those of neighbouring times.
namespace traceflow {

// The extent of a view's mask.
struct MaskExtent {
  std::string id;
  double share = 0;           // of the image
  bool touches_edge = false;  // or almost: the thing may be leaving the image
};
// The indices of implausible extents. The input is ordered by time. An extent is implausible if it is blank,
// or 1.7 times smaller or larger than the median of up to three non-blank ones before and after it. A small
// extent is plausible if the thing may be leaving the image: if it touches the image border, or if the
// nearest non-blank one on either side is small and touches it.
std::vector<size_t> odd_extents(const std::vector<MaskExtent>& extents);

// Removes implausible masks from training views, separately for each camera. A view without a mask gives no
// silhouette, but a wrong mask misleads. Adds a warning that names the views.
void leave_out_odd_masks(Capture& capture);

}  // namespace traceflow
