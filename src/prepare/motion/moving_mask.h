#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "base/tensor.h"
#include "base/work.h"
#include "prepare/motion/motion.h"

// Finds what moves independently of the camera, from motion alone.
namespace traceflow::prepare {

// H×W, 1 where something moves: where, in most of the motions, tracks that do not follow the static part
// outweigh those that do. Places without texture take the result of those around them. Parts below 1/300 of
// the image are dropped; the rest grows by a margin of 1/120 of the longest side. Without motions the mask is
// zero.
Tensor<uint8_t> moving_mask(const Shape& shape, const std::vector<Motion>& motions);

// The mask of every image (8-bit grey, H×W×1, equal sizes, in time order), from the motions to the neighbours
// one and two steps away. A step is the number of images (up to 8) after which most of the image has moved
// enough. `still` gives the motion of the static part from image i to image j, or nothing if the tracks
// should determine it. `picture(i)` is called from several threads. Throws Stopped.
std::vector<Tensor<uint8_t>> moving_masks(
    int64_t count, const std::function<Tensor<uint8_t>(int64_t i)>& picture,
    const std::function<std::optional<TwoView>(int64_t i, int64_t j)>& still, const Work& work);

}  // namespace traceflow::prepare
