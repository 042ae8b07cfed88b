#pragma once

#include <array>
#include <string>
#include <vector>

#include "render/frame.h"
#include "viz/tracks.h"

namespace traceflow::viz {

// The layers of a frame, with their names in flags and folders.
enum class Layer {
  rgb,
  diffuse,
  specular,
  tint,
  roughness,
  alpha,
  normal,
  depth,
  median_depth,
  distortion,
  surfels,
  tracks
};
inline constexpr std::array<const char*, 12> layer_names = {
    "rgb",    "diffuse", "specular",     "tint",       "roughness", "alpha",
    "normal", "depth",   "median-depth", "distortion", "surfels",   "tracks"};
inline const char* to_string(Layer layer) { return layer_names[static_cast<size_t>(layer)]; }

// Whether a layer has colours or normals (H×W×3) and not one number per pixel.
bool has_colours(Layer layer);
// Whether a layer needs traced reflections. Frames for other layers can skip them.
bool needs_reflections(Layer layer);

// Parses "rgb,normal" to layers, each once, in the given order; "all" means all. Throws InputError.
std::vector<Layer> parse_layers(const std::string& list);

// The layer's numbers, H×W or H×W×3: colours; α_spec; alpha; normals in world axes as blended, not
// renormalised; depths along the camera's z in units of 1/`scale` scene units, so that the capture's scale
// gives the capture's units; every surfel as an ellipse (viz/ellipses.h); the colours with `tracks` over them
// (viz/track_picture.h), which no other layer needs. On the host, for frames on any device.
Tensor<float> layer_values(const Frame& frame, Layer layer, double scale, const Tracks& tracks = {});

// H×W: |photograph − render|, the mean of the three channels. The photograph is H×W×3 on the host. Where it
// is unknown (known: H×W, may be empty) the difference is 0.
Tensor<float> difference_values(const Frame& frame, const Tensor<float>& photograph,
                                const Tensor<uint8_t>& known = {});

}  // namespace traceflow::viz
