#pragma once

#include <cstdint>
#include <vector>

#include "prepare/options.h"

namespace traceflow::prepare {

// A picture of a film or folder before any is chosen.
struct Candidate {
  double time = 0;  // seconds, or its place in the folder
  double sharpness = 0;
  int64_t index = 0;  // its place in the film or folder
};

// Cuts the time from --start to --end into --frames equal intervals, or into those of --rate, and takes the
// sharpest candidate of each, the first of equals: their indices, rising. All where there are no more than
// --frames. Candidates come in the order of time. Intervals without a candidate give none.
std::vector<int64_t> choose_frames(const std::vector<Candidate>& candidates, const PrepareOptions& options);

// For each time the candidate that is nearest to it, or -1 where none is within `tolerance`, or where the
// candidate is nearer to another of the times. Both come in the order of time.
std::vector<int64_t> nearest_frames(const std::vector<Candidate>& candidates,
                                    const std::vector<double>& times, double tolerance);

}  // namespace traceflow::prepare
