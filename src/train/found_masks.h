#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "train/still_scene.h"

// Finds masks of moving things if the capture has none: what differs from a static scene trained on the
// video, segmented along edges in the photographs and in the normal priors.
namespace traceflow {

// The share of each pixel that moves (H×W of the view, 255: all), by the id of the training view.
using FoundMasks = std::unordered_map<std::string, Tensor<uint8_t>>;

// The result of a search.
struct FoundObjects {
  FoundMasks masks;
  Tensor<float> standing_points;  // the capture's points that are seen to be static
};

// The iterations for which the static scene trains; 0 if the options or the capture exclude a search, or if
// the run is too short for one.
int iterations_to_find_objects(const Capture& capture, const TrainOptions& options);

// The share of each pixel of a photograph that moves, in [0, 1] (H×W).
Tensor<float> moving_share(const StillScene::Look& still, const ViewImages& photograph);

// Finds moving objects. Loads the capture again, at most 160 pixels wide. Returns nothing if `progress` stops
// it.
std::optional<FoundObjects> find_objects(const Capture& capture, const TrainOptions& options, int iterations,
                                         const StepsDone& progress);

// The share of all pixels that the masks cover.
double covered_share(const FoundMasks& masks);

// Gives the masks and the static points to the capture's training views.
void give_objects(const FoundObjects& found, Capture& capture);

// Writes the masks as images, for resuming and for inspection.
void write_masks(const FoundMasks& masks, const std::filesystem::path& folder);
// Reads the masks of the training views that exist. Throws InputError for one of another size.
FoundMasks read_masks(const std::filesystem::path& folder, const Capture& capture);

}  // namespace traceflow
