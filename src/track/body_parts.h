#pragma once

#include <vector>

#include "scene/motion.h"
#include "scene/surfels.h"

// Several things that one mask shows as one, such as an apple before a kettle.
namespace traceflow {

// A body's surfels by where they lie: groups that are four times as far from one another as points are from
// their neighbours, largest first. Only the first `points` surfels, which are the capture's points, form
// groups; every other surfel joins the group of the nearest. One group, or none, where it hangs together.
std::vector<std::vector<int64_t>> separate_parts(const Surfels& main, int64_t points, int32_t body);

// The same motion, in which a part of a body is a body of its own, the last one, and moves as before. Sets
// main.body. On the CPU.
Motion with_part(const Motion& motion, int32_t body, const std::vector<int64_t>& part, Surfels& main);

}  // namespace traceflow
