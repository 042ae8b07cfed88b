#include "base/printable.h"

#include <algorithm>
#include <cstdint>

namespace traceflow {

namespace {

// Bytes of the UTF-8 character at the beginning of the text that may be shown; 0 where there is none.
size_t shown_bytes(std::string_view text) {
  const auto byte = [&](size_t i) { return static_cast<uint8_t>(text[i]); };
  if (byte(0) < 0x80) return byte(0) >= 0x20 && byte(0) != 0x7f ? 1 : 0;
  const size_t length = byte(0) < 0xc2 ? 0 : byte(0) < 0xe0 ? 2 : byte(0) < 0xf0 ? 3 : byte(0) < 0xf5 ? 4 : 0;
  if (length == 0 || text.size() < length) return 0;
  uint32_t code = byte(0) & (0xffU >> (length + 1));
  for (size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xc0U) != 0x80) return 0;
    code = code << 6 | (byte(i) & 0x3fU);
  }
  constexpr uint32_t smallest[] = {0, 0, 0x80, 0x800, 0x10000};
  const bool is_character = code >= smallest[length] && code <= 0x10ffff && (code < 0xd800 || code > 0xdfff);
  const bool is_control = code < 0xa0;
  // What turns the direction of writing shows a line in another order than it has.
  const bool turns = (code >= 0x200e && code <= 0x200f) || (code >= 0x2028 && code <= 0x202e) ||
                     (code >= 0x2066 && code <= 0x2069);
  return is_character && !is_control && !turns ? length : 0;
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
