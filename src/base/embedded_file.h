#pragma once

#include <span>
#include <string_view>

namespace traceflow {

// A file embedded in the program (cmake/TraceflowEmbed.cmake).
struct EmbeddedFile {
  std::string_view name;  // without its folder
  std::span<const unsigned char> bytes;

  std::string_view text() const { return {reinterpret_cast<const char*>(bytes.data()), bytes.size()}; }
};

}  // namespace traceflow
