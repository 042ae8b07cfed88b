#pragma once

#include <atomic>
#include <filesystem>
#include <string>

#include "capture/formats/colmap_model.h"
#include "prepare/frames.h"

// Cameras and points by the program `colmap`, of versions 3.8 to 3.11.
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
                             const PoseFolder& folder, const std::atomic<bool>& stop);
std::string match_features(const PrepareOptions& options, const Frames& frames, const PoseFolder& folder,
                           const std::atomic<bool>& stop);
// Keeps the model with the most registered frames; it must have 10, and the share that the options ask for.
std::string find_poses(const PrepareOptions& options, const Frames& frames,
                       const std::filesystem::path& pictures, const PoseFolder& folder,
                       const std::atomic<bool>& stop);

// The model that find_poses kept.
ColmapModel read_chosen_model(const PoseFolder& folder);

// The mean distance of a point's projections from its features, in pixels, over all features; of the points.
double mean_error(const ColmapModel& model);

}  // namespace traceflow::prepare
