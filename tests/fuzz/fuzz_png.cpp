// Bytes as a PNG. libpng refuses every chunk whose checksum is wrong, as that of nearly each changed one is:
// most inputs get right ones.
#include <zlib.h>

#include <algorithm>

#include "files/png.h"
#include "fuzz/scratch_file.h"

using namespace traceflow;
using fuzz::promise;

namespace {

uint32_t big_endian(const uint8_t* bytes) {
  return uint32_t{bytes[0]} << 24 | uint32_t{bytes[1]} << 16 | uint32_t{bytes[2]} << 8 | bytes[3];
}

// Of the chunks up to the first that is cut short.
void correct_checksums(uint8_t* data, size_t size) {
  constexpr size_t signature = 8, around = 12;  // length, kind and checksum
  for (size_t at = signature; at + around <= size;) {
    const size_t length = big_endian(data + at);
    if (length > size - at - around) return;
    const auto checksum = static_cast<uint32_t>(crc32(0, data + at + 4, static_cast<uInt>(length + 4)));
    uint8_t* end = data + at + 8 + length;
    for (int i = 0; i < 4; ++i) end[i] = static_cast<uint8_t>(checksum >> (24 - 8 * i));
    at += around + length;
  }
}

}  // namespace

// NOLINTBEGIN(readability-identifier-naming): libFuzzer's names
extern "C" size_t LLVMFuzzerMutate(uint8_t* data, size_t size, size_t most);

extern "C" size_t LLVMFuzzerCustomMutator(uint8_t* data, size_t size, size_t most, unsigned int seed) {
  size = LLVMFuzzerMutate(data, size, most);
  if (seed % 8 != 0) correct_checksums(data, size);
  return size;
}
// NOLINTEND(readability-identifier-naming)

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  // What such a file can hold decodes in time.
  constexpr int64_t most_pixels = int64_t{1} << 20;
  static const fuzz::ScratchFolder folder;
  const auto path = folder.write("a.png", fuzz::text_of(data, size));
  PngSize head{};
  if (!fuzz::accepts(path.string(), [&] { head = read_png_size(path); })) return 0;
  promise(head.width >= 1 && head.width <= 32768 && head.height >= 1 && head.height <= 32768 &&
              head.channels >= 1 && head.channels <= 4,
          "a size is in its range");
  const int64_t pixels = int64_t{head.width} * head.height;
  const bool can_hold = pixels / 8 / 1032 <= static_cast<int64_t>(size);
  if (can_hold && pixels > most_pixels) return 0;
  Tensor<uint8_t> image;
  if (!fuzz::accepts(path.string(), [&] { image = read_png(path); })) return 0;
  promise(can_hold, "an image is no larger than its file can hold");
  promise(image.shape() == Shape{head.height, head.width, head.channels}, "header and image agree");
  Tensor<uint16_t> deep;
  promise(fuzz::accepts(path.string(), [&] { deep = read_png16(InputFile(path)); }), "both depths are read");
  promise(deep.size() >= image.size(), "16 bits lose nothing");
  const auto again = folder.path() / "b.png";
  write_png(again, image);
  const Tensor<uint8_t> read = read_png(again);
  promise(read.shape() == image.shape() && std::equal(image.data(), image.data() + image.size(), read.data()),
          "what is written reads back");
  return 0;
}
