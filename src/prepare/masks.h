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

// Masks of what moves independently of the camera: white, as ID.png, of the frames' size.
namespace traceflow::prepare {

// Whether the options request masks.
bool wants_masks(const PrepareOptions& options);

// Writes a mask for every frame into `masks`, which is first emptied: those of --masks, or estimated ones.
// Returns a text on the result. Throws InputError and Stopped.
std::string make_masks(const PrepareOptions& options, const Frames& frames,
                       const std::filesystem::path& pictures, const std::filesystem::path& masks,
                       const std::filesystem::path& log, const Work& work);

// Assigns supplied masks to frames, in the same way for all. Masks of a folder are assigned by name: for all
// frames of the first camera by the names of their original images, or by the frames' own names. The latter
// is not used if there is one mask for each image of the video, since such names count the video's images.
// Otherwise by order: one mask for each image of the first camera's video, or one for each of its frames.
// Returns for frame i the index of its mask in the folder or video; frames of the second camera have one only
// by name. Throws InputError if no way fits, or if two frames would have the same mask.
std::vector<std::optional<int64_t>> match_masks(const std::string& origin,
                                                const std::vector<std::string>& names, int64_t count,
                                                const Frames& frames);

// Estimates the masks (motion/moving_mask.h) of images of one camera, in time order, and passes each, H×W of
// 0 and 1, to `take`. `lines` gives the motion of the static part from image i to j, in pixels of the image's
// own size, if known. Throws Stopped.
void estimate_masks(const std::vector<std::filesystem::path>& pictures,
                    const std::function<std::optional<TwoView>(int64_t i, int64_t j)>& lines,
                    const Work& work,
                    const std::function<void(int64_t i, const Tensor<uint8_t>& mask)>& take);

// Writes 0 and 1 as black and white.
void write_mask(const std::filesystem::path& path, const Tensor<uint8_t>& mask);
// 1 for values from 50 % up, H×W: of a mask that write_mask wrote.
Tensor<uint8_t> as_mask(const Tensor<uint8_t>& picture);
// The mask at another size, by nearest pixel.
Tensor<uint8_t> resized_mask(const Tensor<uint8_t>& mask, int64_t height, int64_t width);
// Throws InputError if the proportions of a mask or a depth image, whose size is `size`, differ from those of
// the image with this name and size: it was rotated or cropped. field: "masks" or "depth".
void require_proportions(const std::string& origin, const std::string& field, const Vec2<int64_t>& size,
                         const std::string& picture, double width, double height);
// Throws InputError for masks that cover nothing: their white may be a darker grey in a film or JPEG files.
void require_white(const std::string& origin, double covered);
// The fraction of ones.
double share_of(const Tensor<uint8_t>& mask);

}  // namespace traceflow::prepare
