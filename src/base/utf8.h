#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace traceflow {

struct Utf8Character {
  char32_t code = 0;
  size_t bytes = 0;  // that it takes, 1 to 4
};

// The character that the text, which is not empty, begins with; nothing where its first bytes are no UTF-8.
std::optional<Utf8Character> first_utf8_character(std::string_view text);

// The text as UTF-8: each byte that belongs to no character as %XX. Other text stays as it is.
std::string as_utf8(std::string_view text);

}  // namespace traceflow
