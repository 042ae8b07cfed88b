#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/tensor.h"
#include "base/work.h"
#include "prepare/frames.h"
#include "prepare/motion/two_view.h"

// Masks of what moves by itself, white, as ID.png of the frames' size.
namespace traceflow::prepare {

// Whether the options ask for masks at all.
bool wants_masks(const PrepareOptions& options);

// Writes a mask for every frame into `masks`, which is emptied first: those that --masks names, or estimated
// ones. What was found, in words. Throws InputError, and Stopped.
std::string make_masks(const PrepareOptions& options, const Frames& frames,
                       const std::filesystem::path& pictures, const std::filesystem::path& masks,
                       const std::filesystem::path& log, const Work& work);

// Supplied masks by the frames that they belong to, in one way for all. Of a folder by name: all frames of
// the first camera by the pictures that they were taken from, or all by their own names, unless there is one
// mask for each picture of the film, whose names would count those. Else by order: one for each picture of
// the first camera's film, or one for each of its frames. Which picture of the folder or film is the mask of
// frame i; frames of the second camera have one only by name. Throws InputError where no way fits, and where
// two frames would have the same.
std::vector<std::optional<int64_t>> match_masks(const std::string& origin,
                                                const std::vector<std::string>& names, int64_t count,
                                                const Frames& frames);

// Estimates the masks (motion/moving_mask.h) of pictures of one camera, in the order of time, and hands each,
// H×W of 0 and 1, to `take`. `lines` tells how the still part goes from picture i to j, in pixels of the
// picture's own size, where it is known. Throws Stopped.
void estimate_masks(const std::vector<std::filesystem::path>& pictures,
                    const std::function<std::optional<TwoView>(int64_t i, int64_t j)>& lines,
                    const Work& work,
                    const std::function<void(int64_t i, const Tensor<uint8_t>& mask)>& take);

// 0 and 1 as black and white.
void write_mask(const std::filesystem::path& path, const Tensor<uint8_t>& mask);
// White from a half on, H×W.
Tensor<uint8_t> as_mask(const Tensor<uint8_t>& picture);
// The mask at another size, by nearest pixel.
Tensor<uint8_t> resized_mask(const Tensor<uint8_t>& mask, int64_t height, int64_t width);
// Throws InputError for what has other proportions than the picture of this name and size: it was turned, or
// cut.
void require_proportions(const std::string& origin, const Tensor<uint8_t>& mask, const std::string& picture,
                         double width, double height);
// Throws InputError for masks that cover nothing, whose white is perhaps another grey.
void require_white(const std::string& origin, double covered);
// The share of ones.
double share_of(const Tensor<uint8_t>& mask);

}  // namespace traceflow::prepare
