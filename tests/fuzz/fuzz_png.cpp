// Bytes as a PNG.
#include <algorithm>

#include "files/png.h"
#include "fuzz/scratch_file.h"

using namespace traceflow;
using fuzz::promise;

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
