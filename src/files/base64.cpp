#include "files/base64.h"

#include <cstdint>

namespace traceflow {

std::string base64(std::string_view bytes) {
  constexpr std::string_view letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t word = 0;
    for (size_t k = i; k < i + 3; ++k)
      word = word << 8 | (k < bytes.size() ? static_cast<uint8_t>(bytes[k]) : 0U);
    for (size_t k = 0; k < 4; ++k) text += i + k <= bytes.size() ? letters[word >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

}  // namespace traceflow
