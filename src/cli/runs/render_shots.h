#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "runs/loaded_scene.h"
#include "viz/cameras/shot.h"

namespace CLI {
class App;
}

namespace traceflow::cli {

// The flags of `render` that choose cameras and times.
struct ShotArguments {
  std::string split, cameras, camera_path, freeze_camera, capture;
  bool orbit = false, spiral = false;
  bool compare = false;
  std::optional<float> time;
  std::optional<int> frames;
  std::optional<std::pair<int, int>> size;
  std::optional<double> frames_per_second;
  int downscale = 0;

  // Throws InputError with an explanation for flags that exclude each other.
  void check() const;
};
void add_shot_arguments(CLI::App& verb, ShotArguments& arguments);

struct ChosenShots {
  std::vector<viz::Shot> shots;  // each has a time
  // For comparison: one view for each shot, and the capture with their photographs. Otherwise empty.
  std::vector<View> photographs;
  std::optional<Capture> capture;
  std::vector<float> times;  // of the capture, ascending; empty if the cameras did not need it
  double frames_per_second = 30;
};

// Throws InputError.
ChosenShots choose_shots(const ShotArguments& arguments, const LoadedScene& scene);

}  // namespace traceflow::cli
