#pragma once

#include <vector>

#include "scene/motion.h"
#include "scene/surfels.h"

// Separates several things that one mask shows as one, such as an apple in front of a kettle.
namespace traceflow {

// The surfels of a body in spatially separate groups, largest first. The gap between groups is four times the
// distance between neighbours. Only the first `points` surfels, which are the capture's points, form groups;
// each other surfel joins the group of the nearest one. Empty if the body is connected or has too few points.
std::vector<std::vector<int64_t>> separate_parts(const Surfels& main, int64_t points, int32_t body);

// The same motion with a part of a body as a separate body, which is the last one and moves as before. Sets
// main.body. On the CPU.
Motion with_part(const Motion& motion, int32_t body, const std::vector<int64_t>& part, Surfels& main);

}  // namespace traceflow
