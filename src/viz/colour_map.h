#pragma once

#include <array>
#include <string>
#include <string_view>

#include "math/types.h"

namespace traceflow::viz {

// Colour maps for numbers from 0 to 1. ramp: dark violet over green to light yellow; viridis, magma:
// matplotlib's, by van der Walt and Smith (CC0); turbo: Mikhailov's (Apache 2.0); grey: black to white.
enum class ColourMap { ramp, viridis, magma, turbo, grey };
constexpr std::array<std::string_view, 5> enum_names(ColourMap) {
  return {"ramp", "viridis", "magma", "turbo", "grey"};
}

// The map with this name. Throws InputError.
ColourMap parse_colour_map(const std::string& name);

// Values are clamped to 0 to 1; NaN is black.
Vec3<float> map_colour(ColourMap map, float value);

}  // namespace traceflow::viz
