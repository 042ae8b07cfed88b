#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "train/still_scene.h"

// Masks of what moves, where the capture has none: what a still scene of the film does not show, up to the
// edges in the photographs and in the normal priors.
namespace traceflow {

// How much of each pixel of a training view moves (H×W of the view, 255: all), by the views' ids.
using FoundMasks = std::unordered_map<std::string, Tensor<uint8_t>>;

// What a search finds.
struct FoundObjects {
  FoundMasks masks;
  Tensor<float> standing_points;  // those of the capture's points that are seen to stand still
};

// For how many iterations a still scene is trained to find them; 0 where the options or the capture say that
// there is nothing to look for. A run that is too short finds nothing.
int iterations_to_find_objects(const Capture& capture, const TrainOptions& options);

// How much moves at each pixel of a photograph, in [0, 1] (H×W).
Tensor<float> moving_share(const StillScene::Look& still, const ViewImages& photograph);

// Finds them. Loads the capture again, at most 160 pixels wide. None where `told` stops it.
std::optional<FoundObjects> find_objects(const Capture& capture, const TrainOptions& options, int iterations,
                                         const StepsDone& told);

// The share of all pixels that they cover.
double covered_share(const FoundMasks& masks);

// Tells a capture: its training views have these masks then.
void give_objects(const FoundObjects& found, Capture& capture);

// A run keeps them, as pictures, for whoever resumes it or wants to see them.
void write_masks(const FoundMasks& masks, const std::filesystem::path& folder);
// Those of the training views that are there. Throws InputError for one of another size.
FoundMasks read_masks(const std::filesystem::path& folder, const Capture& capture);

}  // namespace traceflow
