// Bytes as a JPEG.
#include "files/image.h"
#include "files/jpeg.h"
#include "fuzz/scratch_file.h"

using namespace traceflow;
using fuzz::promise;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  // What such a file can hold decodes in time.
  constexpr int64_t most_pixels = int64_t{1} << 18;
  static const fuzz::ScratchFolder folder;
  const auto path = folder.write("a.jpg", fuzz::text_of(data, size));
  JpegSize head{};
  if (!fuzz::accepts(path.string(), [&] { head = read_jpeg_size(InputFile(path)); })) return 0;
  promise(head.width >= 1 && head.width <= 32768 && head.height >= 1 && head.height <= 32768 &&
              (head.channels == 1 || head.channels == 3) && head.orientation >= 1 && head.orientation <= 8,
          "a size is in its range");
  ImageSize as_image{};
  if (fuzz::accepts(path.string(), [&] { as_image = read_image_size(InputFile(path)); })) {
    promise(as_image.width == head.width && as_image.height == head.height, "both readers see the same size");
  }
  const int64_t pixels = int64_t{head.width} * head.height;
  // A bit for each block of 16×16 at the least, as colours are halved at the most fourfold each way.
  const bool can_hold = pixels / 1024 / 8 <= static_cast<int64_t>(size);
  if (can_hold && pixels > most_pixels) return 0;
  Tensor<uint8_t> image;
  if (!fuzz::accepts(path.string(), [&] { image = read_jpeg(InputFile(path)); })) return 0;
  promise(can_hold, "an image is no larger than its file can hold");
  promise(image.shape() == Shape{head.height, head.width, head.channels}, "header and image agree");
  const auto again =
      folder.write("b.jpg", jpeg_bytes(head.channels == 1 ? Tensor<uint8_t>({2, 2}) : image, 90));
  promise(!read_jpeg(InputFile(again)).empty(), "what is written reads back");
  return 0;
}
