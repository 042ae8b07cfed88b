#pragma once

#include <filesystem>
#include <string>

#include "base/work.h"
#include "capture/formats/colmap_model.h"
#include "prepare/frames.h"

// From pictures, masks and a model of COLMAP's to a capture in the layout of NeRF-DS.
namespace traceflow::prepare {

struct CaptureParts {
  Frames frames;
  std::filesystem::path pictures, masks;  // ID.png each; masks may lack some, or be missing
  ColmapModel model;                      // its pictures are ID.png
};

// Writes the capture into `folder`, which is emptied first: straightened pictures at full, half and quarter
// size, masks, cameras, points and times of the frames that have a pose. Masks that were estimated are so
// again, by the cameras' own epipolar lines. What was written, in words. Throws InputError where train or
// test were empty, and Stopped.
std::string write_capture(const PrepareOptions& options, const CaptureParts& parts,
                          const std::filesystem::path& folder, const Work& work);

// The points that several pictures agree on: the error is below 2 pixels, and three pictures see them.
std::vector<Vec3<double>> good_points(const ColmapModel& model);

// In a capture: tells that its masks are not those that prepare made.
inline constexpr const char* attached_masks = "mask/attached.txt";

// Throws InputError unless a finished capture may be put at this place: nothing is there, or a capture made
// by prepare to which nothing was added.
void check_place(const std::filesystem::path& capture);
// Throws InputError where an empty folder at this place cannot be moved, as move_into_place will: a mount
// point, say. Moves it to `trial`, where nothing is, and back.
void check_movable(const std::filesystem::path& capture, const std::filesystem::path& trial);
// Puts the finished folder there, in the place of an earlier one, which `aside` is used for.
void move_into_place(const std::filesystem::path& folder, const std::filesystem::path& capture,
                     const std::filesystem::path& aside);

}  // namespace traceflow::prepare
