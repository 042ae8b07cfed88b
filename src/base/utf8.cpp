#include "base/utf8.h"

#include <fmt/format.h>

#include <cstdint>

namespace traceflow {

std::optional<Utf8Character> first_utf8_character(std::string_view text) {
  const auto byte = [&](size_t i) { return static_cast<uint8_t>(text[i]); };
  if (byte(0) < 0x80) return Utf8Character{byte(0), 1};
  const size_t length = byte(0) < 0xc2 ? 0 : byte(0) < 0xe0 ? 2 : byte(0) < 0xf0 ? 3 : byte(0) < 0xf5 ? 4 : 0;
  if (length == 0 || text.size() < length) return std::nullopt;
  char32_t code = byte(0) & (0xffU >> (length + 1));
  for (size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xc0U) != 0x80) return std::nullopt;
    code = code << 6 | (byte(i) & 0x3fU);
  }
  constexpr char32_t smallest[] = {0, 0, 0x80, 0x800, 0x10000};
  const bool is_character = code >= smallest[length] && code <= 0x10ffff && (code < 0xd800 || code > 0xdfff);
  return is_character ? std::optional(Utf8Character{code, length}) : std::nullopt;
}

std::string as_utf8(std::string_view text) {
  std::string result;
  while (!text.empty()) {
    const auto character = first_utf8_character(text);
    const size_t bytes = character ? character->bytes : 1;
    result += character ? std::string(text.substr(0, bytes))
                        : fmt::format("%{:02X}", static_cast<uint8_t>(text[0]));
    text.remove_prefix(bytes);
  }
  return result;
}

}  // namespace traceflow
