#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "base/options.h"

namespace traceflow {

// Axes of the normal priors' camera space, as signs relative to OpenCV's (x right, y down, z forward): opengl
// + − −, opencv + + +, stable_normal − − −. `automatic` is opengl, unless the geometry clearly indicates
// another (docs/captures.md).
enum class PriorAxes { automatic, opengl, opencv, stable_normal };
constexpr std::array<std::string_view, 4> enum_names(PriorAxes) {
  return {"automatic", "opengl", "opencv", "stable-normal"};
}

// The format of a capture (docs/captures.md); `automatic` selects it by the files.
enum class CaptureFormat { automatic, nerfies, dycheck, colmap, transforms };
constexpr std::array<std::string_view, 5> enum_names(CaptureFormat) {
  return {"automatic", "nerfies", "dycheck", "colmap", "transforms"};
}

// What is behind the transparent parts of an image; `automatic` is the format's default.
enum class Background { automatic, black, white, grey };
constexpr std::array<std::string_view, 4> enum_names(Background) {
  return {"automatic", "black", "white", "grey"};
}

// The source of a capture's times: `automatic` is what the format defines, `names` is the order of the file
// names, `none` makes all times 0, for a static scene.
enum class CaptureTimes { automatic, names, none };
constexpr std::array<std::string_view, 3> enum_names(CaptureTimes) { return {"automatic", "names", "none"}; }

struct CaptureOptions {
  CaptureFormat format = CaptureFormat::automatic;
  int downscale = 1;
  CaptureTimes times = CaptureTimes::automatic;
  int test_every = 8;
  Background background = Background::automatic;
  PriorAxes prior_axes = PriorAxes::automatic;
  int64_t cache_mebibytes = 1024;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("format", format, "",
            "Format of the capture: automatic (detected from its files), nerfies (also HyperNeRF, NeRF-DS), "
            "dycheck, colmap, or transforms (NeRF-synthetic, instant-ngp, nerfstudio, D-NeRF).");
    v.field("downscale", downscale, "",
            "Use images of 1/K the size: from rgb/Kx or images_K if it exists, otherwise reduced with a box "
            "filter.");
    v.field("times", times, "",
            "Times of the views: automatic (as the format defines), names (order of the file names), or none "
            "(a static scene).");
    v.field(
        "test_every", test_every, "views",
        "Every n-th view is a test view, if the format does not define the test views; 0: no test views.");
    v.field("background", background, "",
            "Colour behind transparent pixels: automatic (default of the format), black, white, or grey.");
    v.field("prior_axes", prior_axes, "",
            "Axes of the normal priors: automatic, opengl (x right, y up, z to the viewer), "
            "opencv, or stable-normal (opencv negated).");
    v.field("cache_mebibytes", cache_mebibytes, "MiB", "Maximum memory for decoded images.");
  }
  void validate() const;
};

}  // namespace traceflow
