#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "base/work.h"
#include "capture/formats/colmap_model.h"
#include "prepare/frames.h"
#include "prepare/programs.h"

// Cameras and points by the program `colmap`, of versions 3.8 to 4.1.
namespace traceflow::prepare {

// Where COLMAP reads and writes. Logs are beside it.
struct PoseFolder {
  std::filesystem::path top;

  std::filesystem::path features() const { return top / "features.db"; }
  std::filesystem::path matches() const { return top / "matches.db"; }
  std::filesystem::path masks() const { return top / "masks"; }  // black where no features are taken
  std::filesystem::path models() const { return top / "models"; }
  std::filesystem::path chosen() const { return top / "chosen"; }  // names the model's folder
};

// Each tells what it found in words; and throws InputError and Stopped.
std::string extract_features(const PrepareOptions& options, const Frames& frames,
                             const std::filesystem::path& pictures, const std::filesystem::path& masks,
                             const PoseFolder& folder, const Work& work);
std::string match_features(const PrepareOptions& options, const Frames& frames, const PoseFolder& folder,
                           const Work& work);
// Keeps the model with the most registered frames.
std::string find_poses(const PrepareOptions& options, const Frames& frames,
                       const std::filesystem::path& pictures, const PoseFolder& folder, const Work& work);

// The model that find_poses kept.
ColmapModel read_chosen_model(const PoseFolder& folder);
// Throws InputError unless that has 10 frames, and the share that the options ask for.
void require_registered(const PrepareOptions& options, const Frames& frames, const PoseFolder& folder);

// How far COLMAP is, by the last line of these that tells: "Processed file [3/87]"; "Matching image [3/87]"
// and "Matching block [1/3, 2/3]", from 3.13 on "Processing image [3/87]" and "Processing block [1/3, 2/3]";
// of the mapper "Registering image #59 (36)", from 3.12 on "Registering image #59 (num_reg_frames=36)", 36 of
// `frames` by then.
std::optional<Share> share_said(const std::string& said, int64_t frames);

// The mean distance of a point's projections from its features, in pixels, over all features; of the points.
double mean_error(const ColmapModel& model);

}  // namespace traceflow::prepare
