#pragma once

#include <string>
#include <string_view>

namespace traceflow {

// Text from outside made safe for one line of a terminal or a log: valid UTF-8, with "?" for each control
// character and each invalid byte. Text of more than `longest` bytes is cut and ends in "…".
std::string printable(std::string_view text, size_t longest);

}  // namespace traceflow
