#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "base/options.h"

namespace traceflow {

// Axes of the normal priors' camera space, as signs against OpenCV's (x right, y down, z forward): opengl + −
// −, opencv + + +, stable_normal − − −. `automatic` is opengl, unless the geometry clearly speaks for another
// (docs/captures.md).
enum class PriorAxes { automatic, opengl, opencv, stable_normal };
constexpr std::array<std::string_view, 4> enum_names(PriorAxes) {
  return {"automatic", "opengl", "opencv", "stable-normal"};
}

struct CaptureOptions {
  int downscale = 1;
  PriorAxes prior_axes = PriorAxes::automatic;
  int64_t cache_mebibytes = 1024;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("downscale", downscale, "", "Uses rgb/Kx where it exists, else box-filters rgb/1x.");
    v.field("prior_axes", prior_axes, "",
            "Axes of the normal priors: automatic, opengl (x right, y up, z to the viewer), "
            "opencv, or stable-normal (opencv negated).");
    v.field("cache_mebibytes", cache_mebibytes, "MiB", "Memory that decoded images may take.");
  }
  void validate() const;
};

}  // namespace traceflow
