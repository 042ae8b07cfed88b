#pragma once

#include "capture/checks/inspection.h"
#include "capture/checks/view_facts.h"

// Each check looks for one kind of error and adds what it finds. The thresholds are at the top of the files
// and in docs/inspect.md. A check with too little data to compare reports nothing.
namespace traceflow {

using Findings = std::vector<Finding>;

// Fewer views do not show what is usual.
constexpr size_t fewest_views = 5;

// Finds cameras far from the others.
void check_positions(const Capture& capture, Findings& findings);
// Finds cameras that look away from what the others look at.
void check_directions(const Capture& capture, Findings& findings);
// Finds gaps between training times, and views of one camera that share a time.
void check_times(const Capture& capture, Findings& findings);
// Finds points that no view sees, that lie behind all cameras or far away, and views that see hardly any.
// Must run after check_directions and does not report its views again.
Inspection::Sight check_points(const Capture& capture, Findings& findings);

// Finds images that cannot be decoded or have only one colour.
void check_pictures(const std::vector<ViewFacts>& facts, Findings& findings);
// Finds blurred and frozen images and sudden changes of brightness, by comparison with neighbours in time
// from the same camera. All views must have been decoded.
void check_neighbours(const Capture& capture, const std::vector<ViewFacts>& facts, Findings& findings);
void check_masks(const std::vector<ViewFacts>& facts, Findings& findings);
// Finds views with too few priors and views whose priors are rotated against the geometry.
void check_priors(const std::vector<ViewFacts>& facts, Findings& findings);
// Finds tracks that contradict the cameras. Places on masks are left out, since what moves may contradict
// them.
Inspection::Tracks check_tracks(const Capture& capture, const std::vector<ViewFacts>& facts,
                                Findings& findings);

// Finds depth priors that disagree with the points, in all views or in some.
void check_depths(const std::vector<ViewFacts>& facts, Findings& findings);

}  // namespace traceflow
