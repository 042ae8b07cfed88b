#pragma once

#include <string>
#include <string_view>

namespace traceflow {

// Text from outside as it may stand in one line of a terminal or a log: valid UTF-8, in which each control
// character and each byte that belongs to no character is a "?"; of more than `longest` bytes, the beginning
// and "…".
std::string printable(std::string_view text, size_t longest);

}  // namespace traceflow
