#pragma once

#include <map>
#include <string>

#include "capture/capture.h"
#include "files/eight_bit.h"
#include "viz/colour_map.h"
#include "viz/drawing.h"

// Shared by the parts of the capture's picture.
namespace traceflow::viz {

inline constexpr int64_t picture_width = 1200, picture_gap = 6;
inline constexpr Ink paper{24, 26, 30}, text_ink{215, 218, 222}, pale_ink{130, 136, 144},
    alarm_ink{255, 70, 60}, mask_ink{90, 255, 120}, test_ink{255, 255, 255};

inline Ink time_ink(float time) {
  const Vec3<float> colour = map_colour(ColourMap::turbo, 0.08F + 0.84F * time);
  return {to_8bit(colour.x), to_8bit(colour.y), to_8bit(colour.z)};
}

// View id → the kind of the finding about it.
using Marks = std::map<std::string, std::string>;
// The kind for cameras apart from the others.
inline constexpr const char* apart_kind = "camera-apart";

}  // namespace traceflow::viz
