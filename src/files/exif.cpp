#include "files/exif.h"

#include <cstdint>
#include <cstring>

namespace traceflow {

namespace {

constexpr char preamble[] = {'E', 'x', 'i', 'f', '\0', '\0'};
constexpr uint32_t orientation_tag = 0x0112;
constexpr uint32_t short_type = 3;
constexpr size_t entry_size = 12;

// Reads numbers of a TIFF structure in its byte order; 0 past its end.
struct Tiff {
  std::span<const std::byte> bytes;
  bool little = true;

  uint32_t number(size_t at, size_t width) const {
    if (at > bytes.size() || width > bytes.size() - at) return 0;
    uint32_t value = 0;
    for (size_t i = 0; i < width; ++i) {
      value = value << 8 | std::to_integer<uint32_t>(bytes[little ? at + width - 1 - i : at + i]);
    }
    return value;
  }
};

}  // namespace

int exif_orientation(std::span<const std::byte> segment) {
  if (segment.size() < sizeof(preamble) || std::memcmp(segment.data(), preamble, sizeof(preamble)) != 0)
    return 1;
  Tiff tiff{segment.subspan(sizeof(preamble))};
  tiff.little = tiff.number(0, 2) == 0x4949;
  if ((!tiff.little && tiff.number(0, 2) != 0x4d4d) || tiff.number(2, 2) != 42) return 1;
  const size_t directory = tiff.number(4, 4), entries = tiff.number(directory, 2);
  for (size_t i = 0; i < entries; ++i) {
    const size_t entry = directory + 2 + i * entry_size;
    if (tiff.number(entry, 2) != orientation_tag || tiff.number(entry + 2, 2) != short_type) continue;
    const uint32_t orientation = tiff.number(entry + 8, 2);
    return orientation >= 1 && orientation <= 8 ? static_cast<int>(orientation) : 1;
  }
  return 1;
}

}  // namespace traceflow
