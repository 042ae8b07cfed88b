#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace traceflow {

struct Utf8Character {
  char32_t code = 0;
  size_t bytes = 0;  // of this character, 1 to 4
};

// The character at the beginning of the text, which must not be empty; nullopt if its first bytes are not
// UTF-8.
std::optional<Utf8Character> first_utf8_character(std::string_view text);

// The text as UTF-8, with %XX for each byte that belongs to no character. Other text is unchanged.
std::string as_utf8(std::string_view text);

}  // namespace traceflow
