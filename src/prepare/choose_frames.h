#pragma once

#include <cstdint>
#include <vector>

#include "prepare/options.h"

namespace traceflow::prepare {

// An image of a video or folder, before selection.
struct Candidate {
  double time = 0;  // seconds, or its index in the folder
  double sharpness = 0;
  int64_t index = 0;  // its index in the video or folder
};

// Divides the time from --start to --end into --frames equal intervals, or into those of --rate. Selects the
// sharpest candidate of each interval, or the first of equally sharp ones. Returns their indices, ascending.
// Selects all if there are at most --frames. Candidates must be in time order. Intervals without candidates
// are skipped.
std::vector<int64_t> choose_frames(const std::vector<Candidate>& candidates, const PrepareOptions& options);

// For each time the nearest candidate. -1 if none is within `tolerance`, or if the candidate is nearer to
// another of the times. Both lists must be in time order.
std::vector<int64_t> nearest_frames(const std::vector<Candidate>& candidates,
                                    const std::vector<double>& times, double tolerance);

}  // namespace traceflow::prepare
