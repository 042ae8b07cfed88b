#pragma once

#include <array>
#include <string>
#include <vector>

#include "render/frame.h"

namespace traceflow::show {

// The pictures that a frame is made of, as they are named in flags and folders.
enum class Layer { rgb, diffuse, specular, tint, alpha, normal, depth, median_depth, distortion };
inline constexpr std::array<const char*, 9> layer_names = {
    "rgb", "diffuse", "specular", "tint", "alpha", "normal", "depth", "median-depth", "distortion"};
inline const char* to_string(Layer layer) { return layer_names[static_cast<size_t>(layer)]; }

// "rgb,normal" → layers, each once, in the order given; "all" is all of them. Throws InputError.
std::vector<Layer> parse_layers(const std::string& list);

// The layer's numbers, H×W or H×W×3: colours; α_spec; alpha; normals in world axes as blended, not
// renormalised; depths along the camera's z in units of 1/`scale` scene units, so that the capture's scale
// gives the capture's units. On the host, wherever the frame is.
Tensor<float> layer_values(const Frame& frame, Layer layer, double scale);

}  // namespace traceflow::show
