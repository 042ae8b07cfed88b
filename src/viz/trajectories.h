#pragma once

#include <filesystem>
#include <functional>
#include <vector>

#include "viz/subject.h"

namespace traceflow::viz {

// Paths of N moving main surfels through T views. On the host.
struct Trajectories {
  Tensor<float> time;      // T, ascending, 0 to 1
  Tensor<float> position;  // T×N×3, the capture's coordinates
  Tensor<float>
      tracks;  // T×N×2, pixels of the view at each time, 0 at the centre of the first: x right, y down
  Tensor<float> visibility;  // T×N: 1 if the surfel is in the image and not behind another surface, else 0
  std::vector<float> hue;    // N, 0 to 1

  int64_t count() const { return static_cast<int64_t>(hue.size()); }
};

// Called after each view with the number of those that are done, and of all.
using TrajectoryProgress = std::function<void(size_t done, size_t all)>;

// Follows the surfels that TrackFollower chooses with subject.render.tracks, through shots that all have a
// time. Shots are sorted by time. Throws InputError if nothing moves.
Trajectories follow_surfels(const Subject& subject, std::vector<Shot> shots,
                            const TrajectoryProgress& progress = {});

// Arrays `tracks`, `visibility`, `position` and `time` as above; the first two are as CoTracker returns them.
// Written atomically.
void write_trajectories_npz(const std::filesystem::path& path, const Trajectories& trajectories);

// One line through the positions of each surfel, in the colour of its hue, as binary glTF
// (files/glb_writer.h). Written atomically.
void write_trajectories_glb(const std::filesystem::path& path, const Trajectories& trajectories);

}  // namespace traceflow::viz
