#include "base/printable.h"

#include <algorithm>

#include "base/utf8.h"

namespace traceflow {

namespace {

// Bytes of the printable character at the beginning of the text; 0 if there is none.
size_t shown_bytes(std::string_view text) {
  const auto character = first_utf8_character(text);
  if (!character) return 0;
  const char32_t code = character->code;
  const bool is_control = code < 0x20 || (code >= 0x7f && code < 0xa0);
  // Characters that change the direction of writing would display a line in another order.
  const bool turns = (code >= 0x200e && code <= 0x200f) || (code >= 0x2028 && code <= 0x202e) ||
                     (code >= 0x2066 && code <= 0x2069);
  return is_control || turns ? 0 : character->bytes;
}

}  // namespace

std::string printable(std::string_view text, size_t longest) {
  std::string result;
  for (size_t at = 0; at < text.size();) {
    const size_t bytes = shown_bytes(text.substr(at));
    if (result.size() + std::max<size_t>(bytes, 1) > longest) return result + "…";
    bytes == 0 ? result.push_back('?') : void(result.append(text.substr(at, bytes)));
    at += std::max<size_t>(bytes, 1);
  }
  return result;
}

}  // namespace traceflow
