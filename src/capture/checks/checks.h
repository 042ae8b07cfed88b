#pragma once

#include "capture/checks/inspection.h"
#include "capture/checks/view_facts.h"

// Each looks for one kind of thing that can be wrong and adds what it finds. Thresholds stand at the top of
// the files and in docs/inspect.md; where there is too little to compare with, nothing is said.
namespace traceflow {

using Findings = std::vector<Finding>;

// Fewer do not tell what is usual.
constexpr size_t fewest_views = 5;

// Cameras far from where the others are.
void check_positions(const Capture& capture, Findings& findings);
// Cameras that do not look where the others look.
void check_directions(const Capture& capture, Findings& findings);
// Gaps between training times; views of one camera that share a time.
void check_times(const Capture& capture, Findings& findings);
// Points that nobody sees, that lie behind all cameras or far out; views that see hardly any. Comes after
// check_directions, whose views it does not name again.
Inspection::Sight check_points(const Capture& capture, Findings& findings);

// Pictures that cannot be decoded, or are of one colour.
void check_pictures(const std::vector<ViewFacts>& facts, Findings& findings);
// Blurred, frozen, and suddenly brighter or darker pictures, each against its neighbours in time from the
// same camera. All views must have been decoded.
void check_neighbours(const Capture& capture, const std::vector<ViewFacts>& facts, Findings& findings);
void check_masks(const std::vector<ViewFacts>& facts, Findings& findings);
// Priors that are empty or, view by view, turned against the geometry.
void check_priors(const std::vector<ViewFacts>& facts, Findings& findings);

}  // namespace traceflow
