#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "base/work.h"
#include "capture/formats/colmap/colmap_model.h"
#include "prepare/frames.h"
#include "prepare/programs.h"

// Finds cameras and points with the program `colmap`, versions 3.8 to 4.1.
namespace traceflow::prepare {

// COLMAP's folder for input and output; it also contains the logs.
struct PoseFolder {
  std::filesystem::path top;

  std::filesystem::path features() const { return top / "features.db"; }
  std::filesystem::path matches() const { return top / "matches.db"; }
  std::filesystem::path masks() const { return top / "masks"; }  // black: no features
  std::filesystem::path models() const { return top / "models"; }
  std::filesystem::path chosen() const { return top / "chosen"; }  // the name of the chosen model's folder
};

// Each returns a text on its result, and throws InputError and Stopped.
std::string extract_features(const PrepareOptions& options, const Frames& frames,
                             const std::filesystem::path& pictures, const std::filesystem::path& masks,
                             const PoseFolder& folder, const Work& work);
std::string match_features(const PrepareOptions& options, const Frames& frames, const PoseFolder& folder,
                           const Work& work);
// Keeps the model with the most registered frames.
std::string find_poses(const PrepareOptions& options, const Frames& frames,
                       const std::filesystem::path& pictures, const PoseFolder& folder, const Work& work);

// The model that find_poses chose.
ColmapModel read_chosen_model(const PoseFolder& folder);
// Throws InputError unless that model has 10 frames and the fraction of frames that the options require.
void require_registered(const PrepareOptions& options, const Frames& frames, const PoseFolder& folder);

// COLMAP's progress, from the last of these lines that shows it: "Processed file [3/87]"; "Matching image
// [3/87]" and "Matching block [1/3, 2/3]", since 3.13 "Processing image [3/87]" and "Processing block [1/3,
// 2/3]"; of the mapper "Registering image #59 (36)", since 3.12 "Registering image #59 (num_reg_frames=36)",
// which means 36 of `frames`.
std::optional<Share> share_said(const std::string& said, int64_t frames);

// The mean distance between a point's projections and its features, in pixels, over all features of the
// points.
double mean_error(const ColmapModel& model);

}  // namespace traceflow::prepare
