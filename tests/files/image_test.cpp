#include "files/image.h"

#include <gtest/gtest.h>

#include <fstream>

#include "base/error.h"
#include "files/jpeg.h"
#include "files/png.h"
#include "support/temp_folder.h"

namespace traceflow {
namespace {

InputFile file_of(const TempFolder& folder, const std::string& name, const std::string& bytes) {
  std::ofstream(folder / name, std::ios::binary) << bytes;
  return InputFile(folder / name);
}

Tensor<uint8_t> ramp(const Shape& shape) {
  Tensor<uint8_t> pixels(shape);
  for (int64_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<uint8_t>(i % 251);
  return pixels;
}

// Names lie: the first bytes tell.
TEST(Image, the_content_says_what_it_is) {
  const TempFolder folder;
  const Tensor<uint8_t> pixels = ramp({5, 7, 4});
  const InputFile png = file_of(folder, "a.jpg", png_bytes(pixels));
  const Tensor<uint8_t> read = read_image(png);
  ASSERT_EQ(read.shape(), pixels.shape());
  EXPECT_TRUE(std::equal(read.data(), read.data() + read.size(), pixels.data()));
  const ImageSize size = read_image_size(png);
  EXPECT_TRUE(size.width == 7 && size.height == 5 && size.channels == 4 && size.bits == 8);

  const InputFile jpeg = file_of(folder, "b.png", jpeg_bytes(ramp({5, 7, 3}), 95));
  EXPECT_EQ(read_image(jpeg).shape(), (Shape{5, 7, 3}));
  const ImageSize jpeg_size = read_image_size(jpeg);
  EXPECT_TRUE(jpeg_size.width == 7 && jpeg_size.height == 5 && jpeg_size.channels == 3);
}

TEST(Image, eight_bits_fill_sixteen) {
  const TempFolder folder;
  const InputFile jpeg = file_of(folder, "b.jpg", jpeg_bytes(ramp({16, 16, 3}), 95));
  const InputFile png = file_of(folder, "b.png", png_bytes(ramp({16, 16, 3})));
  for (const InputFile* file : {&jpeg, &png}) {
    const Tensor<uint8_t> eight = read_image(*file);
    const Tensor<uint16_t> sixteen = read_image16(*file);
    ASSERT_EQ(sixteen.shape(), eight.shape());
    for (int64_t i = 0; i < eight.size(); ++i) ASSERT_EQ(sixteen[i], 257 * eight[i]);
  }
}

TEST(Image, other_formats_are_refused_by_name) {
  const TempFolder folder;
  const std::pair<std::string, std::string> cases[] = {{std::string("RIFF\x10\0\0\0WEBPVP8 ", 16), "WebP"},
                                                       {"GIF89a..", "GIF"},
                                                       {std::string("II*\0\x08\0\0\0", 8), "TIFF"},
                                                       {std::string("\0\0\0\x18"
                                                                    "ftypheic",
                                                                    12),
                                                        "HEIC"},
                                                       {"BM......", "BMP"},
                                                       {"<html>404 not found", "\"<html>40\""},
                                                       {"", "an empty file"},
                                                       {"\x89P", "\".P\""}};
  for (const auto& [bytes, name] : cases) {
    const InputFile file = file_of(folder, "image.png", bytes);
    for (const auto& read :
         {+[](const InputFile& f) { read_image(f); }, +[](const InputFile& f) { read_image16(f); },
          +[](const InputFile& f) { read_image_size(f); }}) {
      try {
        read(file);
        FAIL() << name;
      } catch (const InputError& error) {
        const std::string line = error.what();
        EXPECT_NE(line.find((folder / "image.png").string()), std::string::npos) << line;
        EXPECT_NE(line.find(name), std::string::npos) << line;
      }
    }
  }
}

TEST(Image, names_of_images) {
  for (const char* name : {"a.png", "b/c.JPG", "x.jpeg", "x.Png"}) EXPECT_TRUE(has_image_name(name)) << name;
  for (const char* name : {"png", ".png.txt", "a.tif", "", "a."}) EXPECT_FALSE(has_image_name(name)) << name;
}

}  // namespace
}  // namespace traceflow
