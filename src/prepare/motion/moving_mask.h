#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "base/tensor.h"
#include "base/work.h"
#include "prepare/motion/motion.h"

// Where something moves by itself, told from motion alone.
namespace traceflow::prepare {

// H×W, 1 where something moves: where the tracks that do not obey outweigh those that do, in most of the
// motions. Places without texture follow those around them. What is smaller than 1/300 of the picture is
// dropped; the rest grows by a margin of 1/120 of the picture's longest side. Empty motions give an empty
// mask (zeros).
Tensor<uint8_t> moving_mask(const Shape& shape, const std::vector<Motion>& motions);

// The same for every picture (8-bit grey, H×W×1, all of one size, in the order of time) from its motions to
// the neighbours one and two steps away; a step is as many pictures (up to 8) as it takes for most of the
// picture to move. `still` says how the still part goes from picture i to picture j, or nothing where that is
// to be found from the tracks. `picture(i)` is called from several threads. Throws Stopped.
std::vector<Tensor<uint8_t>> moving_masks(
    int64_t count, const std::function<Tensor<uint8_t>(int64_t i)>& picture,
    const std::function<std::optional<TwoView>(int64_t i, int64_t j)>& still, const Work& work);

}  // namespace traceflow::prepare
