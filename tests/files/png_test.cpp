#include "files/png.h"

#include <gtest/gtest.h>
#include <png.h>
#include <rapidcheck/gtest.h>
#include <sys/resource.h>
#include <zlib.h>

#include <cmath>
#include <cstdio>
#include <limits>

#include "base/error.h"
#include "base/random.h"
#include "support/file_bytes.h"
#include "support/refusal.h"
#include "support/temp_folder.h"

namespace traceflow {
namespace {

Tensor<uint8_t> random_pixels(const Shape& shape, uint64_t seed) {
  Tensor<uint8_t> pixels(shape);
  Random random(seed);
  for (uint8_t& v : pixels.values()) v = static_cast<uint8_t>(random.below(256));
  return pixels;
}

void expect_equal(const Tensor<uint8_t>& a, const Tensor<uint8_t>& b) {
  ASSERT_EQ(a.shape(), b.shape());
  EXPECT_TRUE(std::equal(a.data(), a.data() + a.size(), b.data()));
}

// A file written by libpng directly, for kinds that write_png does not make.
void write_raw(const std::filesystem::path& path, int width, int height, int depth, int colour_type,
               int interlace, const std::vector<std::vector<uint8_t>>& rows,
               const std::vector<png_color>& palette = {}, const std::vector<uint8_t>& transparency = {}) {
  FILE* file = std::fopen(path.c_str(), "wb");
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_init_io(png, file);
  png_set_IHDR(png, info, static_cast<png_uint_32>(width), static_cast<png_uint_32>(height), depth,
               colour_type, interlace, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  if (!palette.empty()) png_set_PLTE(png, info, palette.data(), static_cast<int>(palette.size()));
  if (!transparency.empty()) {
    png_set_tRNS(png, info, transparency.data(), static_cast<int>(transparency.size()), nullptr);
  }
  std::vector<png_bytep> pointers;
  pointers.reserve(rows.size());
  for (const auto& row : rows) pointers.push_back(const_cast<png_bytep>(row.data()));
  png_set_rows(png, info, pointers.data());
  png_write_png(png, info, PNG_TRANSFORM_IDENTITY, nullptr);
  png_destroy_write_struct(&png, &info);
  std::fclose(file);
}

RC_GTEST_PROP(Png, write_then_read_is_the_same_image, ()) {
  const TempFolder folder;
  const auto path = folder / "image.png";
  const Shape shape{*rc::gen::inRange(1, 40), *rc::gen::inRange(1, 40), *rc::gen::inRange(1, 5)};
  const Tensor<uint8_t> pixels = random_pixels(shape, *rc::gen::arbitrary<uint64_t>());
  write_png(path, pixels);
  const Tensor<uint8_t> read = read_png(path);
  RC_ASSERT(read.shape() == shape);
  RC_ASSERT(std::equal(read.data(), read.data() + read.size(), pixels.data()));
  const PngSize size = read_png_size(path);
  RC_ASSERT(size.height == shape[0] && size.width == shape[1] && size.channels == shape[2]);
}

TEST(Png, bytes_are_those_of_the_file) {
  const TempFolder folder;
  const Tensor<uint8_t> pixels = random_pixels({7, 9, 3}, 2);
  write_png(folder / "image.png", pixels);
  EXPECT_EQ(png_bytes(pixels), bytes_of(folder / "image.png"));
  EXPECT_THROW(png_bytes(Tensor<uint8_t>({1, 32769})), InputError);
}

TEST(Png, grey_of_rank_two_reads_as_one_channel) {
  const TempFolder folder;
  Tensor<uint8_t> pixels = random_pixels({3, 5}, 1);
  write_png(folder / "grey.png", pixels);
  const Tensor<uint8_t> read = read_png(folder / "grey.png");
  EXPECT_EQ(read.shape(), (Shape{3, 5, 1}));
  EXPECT_TRUE(std::equal(read.data(), read.data() + read.size(), pixels.data()));
}

TEST(Png, sixteen_bits_are_kept_where_asked_and_else_rounded) {
  const TempFolder folder;
  std::vector<uint8_t> row;
  for (int v = 0; v < 65536; ++v) {
    row.push_back(static_cast<uint8_t>(v >> 8));
    row.push_back(static_cast<uint8_t>(v & 255));
  }
  write_raw(folder / "deep.png", 16384, 1, 16, PNG_COLOR_TYPE_RGB_ALPHA, PNG_INTERLACE_NONE, {row});
  const InputFile file(folder / "deep.png");
  const Tensor<uint8_t> rounded = read_png(file);
  const Tensor<uint16_t> kept = read_png16(file);
  ASSERT_EQ(rounded.shape(), (Shape{1, 16384, 4}));
  ASSERT_EQ(kept.shape(), (Shape{1, 16384, 4}));
  for (int v = 0; v < 65536; ++v) {
    ASSERT_EQ(kept[v], v);
    ASSERT_EQ(rounded[v], std::lround(v / 257.0)) << v;
  }
  EXPECT_EQ(read_png_size(file).bits, 16);
}

TEST(Png, fewer_bits_fill_sixteen) {
  const TempFolder folder;
  write_raw(folder / "palette.png", 2, 1, 8, PNG_COLOR_TYPE_PALETTE, PNG_INTERLACE_NONE, {{1, 0}},
            {{1, 2, 3}, {4, 5, 255}}, {255, 7});
  const Tensor<uint16_t> palette = read_png16(InputFile(folder / "palette.png"));
  ASSERT_EQ(palette.shape(), (Shape{1, 2, 4}));
  const int expected[] = {4, 5, 255, 7, 1, 2, 3, 255};
  for (int i = 0; i < 8; ++i) EXPECT_EQ(palette[i], 257 * expected[i]) << i;

  write_raw(folder / "bits.png", 8, 1, 1, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_ADAM7, {{0b10100001}});
  const Tensor<uint16_t> bits = read_png16(InputFile(folder / "bits.png"));
  ASSERT_EQ(bits.shape(), (Shape{1, 8, 1}));
  EXPECT_EQ(bits[0], 65535);
  EXPECT_EQ(bits[1], 0);
  EXPECT_EQ(read_png_size(folder / "bits.png").bits, 1);
}

TEST(Png, palettes_small_depths_and_interlacing_expand) {
  const TempFolder folder;
  write_raw(folder / "palette.png", 2, 1, 8, PNG_COLOR_TYPE_PALETTE, PNG_INTERLACE_NONE, {{1, 0}},
            {{1, 2, 3}, {4, 5, 6}}, {255, 7});
  const Tensor<uint8_t> palette = read_png(folder / "palette.png");
  ASSERT_EQ(palette.shape(), (Shape{1, 2, 4}));
  const uint8_t expected[] = {4, 5, 6, 7, 1, 2, 3, 255};
  EXPECT_TRUE(std::equal(expected, expected + 8, palette.data()));

  write_raw(folder / "bits.png", 8, 1, 1, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_ADAM7, {{0b10100001}});
  const Tensor<uint8_t> bits = read_png(folder / "bits.png");
  ASSERT_EQ(bits.shape(), (Shape{1, 8, 1}));
  const uint8_t expected_bits[] = {255, 0, 255, 0, 0, 0, 0, 255};
  EXPECT_TRUE(std::equal(expected_bits, expected_bits + 8, bits.data()));
}

TEST(Png, a_blank_bilevel_image_is_not_taken_for_a_bomb) {
  const TempFolder folder;
  const std::vector<std::vector<uint8_t>> rows(8000, std::vector<uint8_t>(1000, 0));
  write_raw(folder / "blank.png", 8000, 8000, 1, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE, rows);
  EXPECT_EQ(read_png(folder / "blank.png").shape(), (Shape{8000, 8000, 1}));
}

TEST(PngHostile, every_truncation_is_refused) {
  const TempFolder folder;
  write_png(folder / "whole.png", random_pixels({9, 7, 3}, 2));
  const std::string bytes = bytes_of(folder / "whole.png");
  for (size_t length = 0; length < bytes.size(); ++length) {
    write_bytes(folder / "cut.png", bytes.substr(0, length));
    EXPECT_THROW(read_png(folder / "cut.png"), InputError) << length;
  }
}

TEST(PngHostile, every_flipped_byte_is_refused_or_read_at_the_same_size) {
  const TempFolder folder;
  write_png(folder / "whole.png", random_pixels({4, 6, 3}, 3));
  const std::string bytes = bytes_of(folder / "whole.png");
  for (size_t at = 0; at < bytes.size(); ++at) {
    std::string broken = bytes;
    broken[at] = static_cast<char>(broken[at] ^ 0x55);
    write_bytes(folder / "broken.png", broken);
    try {
      EXPECT_EQ(read_png(folder / "broken.png").shape(), (Shape{4, 6, 3}));
    } catch (const InputError&) {
    }
  }
}

// A header of a size that is valid in itself, with a correct checksum.
std::string header_only(uint32_t width, uint32_t height) {
  std::string png = "\x89PNG\r\n\x1a\n";
  std::string chunk = "IHDR";
  for (const uint32_t n : {width, height}) {
    for (int shift = 24; shift >= 0; shift -= 8) chunk += static_cast<char>(n >> shift & 0xff);
  }
  chunk += {'\x08', '\x02', '\x00', '\x00', '\x00'};
  uint32_t crc = 0xffffffff;
  for (const char c : chunk) {
    crc ^= static_cast<uint8_t>(c);
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1) != 0 ? 0xedb88320U : 0U);
  }
  crc = ~crc;
  png += std::string{'\0', '\0', '\0', '\x0d'} + chunk;
  for (int shift = 24; shift >= 0; shift -= 8) png += static_cast<char>(crc >> shift & 0xff);
  return png + std::string{'\0', '\0', '\0', '\0'} + "IDAT" + std::string{'\x35', '\xaf', '\x06', '\x1e'};
}

int64_t most_memory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return int64_t{usage.ru_maxrss} << 10;
}

// Eight kilobytes of file each.
TEST(PngHostile, text_that_unpacks_to_megabytes_is_passed_over) {
  const TempFolder folder;
  write_png(folder / "image.png", random_pixels({4, 6, 3}, 3));
  std::string bytes = bytes_of(folder / "image.png");
  std::string text("zTXta\0\0", 7);
  {
    const std::string zeros(7 << 20, '\0');
    std::string packed(compressBound(zeros.size()), '\0');
    uLongf size = packed.size();
    compress(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(zeros.data()),
             zeros.size());
    text += packed.substr(0, size);
  }
  const auto big_endian = [](uint64_t n) {
    return std::string{static_cast<char>(n >> 24), static_cast<char>(n >> 16), static_cast<char>(n >> 8),
                       static_cast<char>(n)};
  };
  const uLong checksum =
      crc32(0, reinterpret_cast<const Bytef*>(text.data()), static_cast<uInt>(text.size()));
  for (int i = 0; i < 100; ++i)
    bytes.insert(bytes.find("IDAT") - 4, big_endian(text.size() - 4) + text + big_endian(checksum));
  write_bytes(folder / "image.png", bytes);
  const int64_t before = most_memory();
  EXPECT_EQ(read_png(folder / "image.png").shape(), (Shape{4, 6, 3}));
  EXPECT_LT(most_memory() - before, int64_t{64} << 20);
}

TEST(PngHostile, huge_headers_are_refused_before_memory_is_taken) {
  const TempFolder folder;
  write_bytes(folder / "huge.png", header_only(32768, 8192));
  EXPECT_EQ(read_png_size(folder / "huge.png").width, 32768);
  EXPECT_THROW(read_png(folder / "huge.png"), InputError);
  write_bytes(folder / "more.png", header_only(32768, 8193));
  EXPECT_THROW(read_png_size(folder / "more.png"), InputError);
}

TEST(PngHostile, a_side_out_of_range_is_refused_by_name) {
  const TempFolder folder;
  const auto path = folder / "image.png";
  const auto refusal = [&](uint32_t width, uint32_t height) {
    write_bytes(path, header_only(width, height));
    return refusal_of([&] { read_png_size(path); });
  };
  const std::string expected = ", expected 1 to 32768 pixels; ", again = "write or copy the file again",
                    smaller = "scale the image down";
  EXPECT_EQ(refusal(32768, 1), "accepted");
  EXPECT_EQ(refusal(32769, 1), path.string() + ": width: found 32769" + expected + smaller);
  EXPECT_EQ(refusal(0, 1), path.string() + ": width: found 0" + expected + again);
  EXPECT_EQ(refusal(1, 0), path.string() + ": height: found 0" + expected + again);
  EXPECT_EQ(refusal(1, 0xffffffff), path.string() + ": height: found 4294967295" + expected + smaller);
}

TEST(PngHostile, what_is_not_a_png_names_the_file) {
  const TempFolder folder;
  write_bytes(folder / "text.png", "hello");
  for (const char* name : {"text.png", "missing.png", "."}) {
    try {
      read_png(folder / name);
      FAIL() << name;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find((folder / name).string()), std::string::npos) << error.what();
    }
  }
}

TEST(EightBit, rounds_to_nearest_and_clamps) {
  Tensor<float> image({8});
  const float values[] = {0,
                          1,
                          0.5F,
                          -3,
                          7,
                          std::numeric_limits<float>::quiet_NaN(),
                          std::numeric_limits<float>::infinity(),
                          100.4F / 255.0F};
  const uint8_t expected[] = {0, 255, 128, 0, 255, 0, 255, 100};
  std::copy(std::begin(values), std::end(values), image.data());
  const Tensor<uint8_t> result = to_8bit(image);
  for (int i = 0; i < 8; ++i) EXPECT_EQ(result[i], expected[i]) << i;
}

TEST(EightBit, every_byte_survives_the_round_trip) {
  Tensor<uint8_t> bytes({256});
  for (int i = 0; i < 256; ++i) bytes[i] = static_cast<uint8_t>(i);
  expect_equal(to_8bit(from_8bit(bytes)), bytes);
  EXPECT_EQ(from_8bit(bytes)[255], 1.0F);
}

}  // namespace
}  // namespace traceflow
