#pragma once

#include <array>
#include <string_view>

namespace traceflow::prepare {

// What is white in masks.
enum class MaskWhite { automatic, moving, static_scene };
constexpr std::array<std::string_view, 3> enum_names(MaskWhite) { return {"automatic", "moving", "static"}; }

}  // namespace traceflow::prepare
