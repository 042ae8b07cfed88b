#pragma once

#include <filesystem>
#include <string>

#include "base/work.h"
#include "capture/formats/colmap/colmap_model.h"
#include "prepare/frames.h"

// Writes images, masks and a COLMAP model as a capture in NeRF-DS's layout.
namespace traceflow::prepare {

struct CaptureParts {
  Frames frames;
  std::filesystem::path pictures, masks;  // ID.png each; masks may be incomplete or missing
  ColmapModel model;                      // its images are ID.png
};

// Writes the capture into `folder`, which is first emptied: undistorted images at full, half and quarter
// size, masks, cameras, points and times of the frames with a pose. Estimated masks are estimated again with
// the cameras' epipolar lines. Returns a text on what was written. Throws InputError if train or test would
// be empty, and Stopped.
std::string write_capture(const PrepareOptions& options, const CaptureParts& parts,
                          const std::filesystem::path& folder, const Work& work);

// The points with an error below 2 pixels that at least three images see.
std::vector<Vec3<double>> good_points(const ColmapModel& model);

// A file in a capture: its masks are not those that prepare made.
inline constexpr const char* attached_masks = "mask/attached.txt";

// Throws InputError unless a finished capture may be put here: the place is free, or has a capture made by
// prepare to which nothing was added.
void check_place(const std::filesystem::path& capture);
// Throws InputError if an empty folder at this place cannot be moved as in move_into_place, for example
// because it is a mount point. Moves it to `trial`, which must not exist, and back.
void check_movable(const std::filesystem::path& capture, const std::filesystem::path& trial);
// Moves the finished folder to this place. An earlier capture there is first moved to `aside`, then removed.
void move_into_place(const std::filesystem::path& folder, const std::filesystem::path& capture,
                     const std::filesystem::path& aside);

}  // namespace traceflow::prepare
