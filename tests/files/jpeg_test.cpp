#include "files/jpeg.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <cstdio>

#include <jpeglib.h>

#include "base/error.h"
#include "base/random.h"

namespace traceflow {
namespace {

// By libjpeg's own decoder; its default error handler ends the program, which is red enough.
Tensor<uint8_t> decoded(const std::string& bytes) {
  jpeg_decompress_struct jpeg{};
  jpeg_error_mgr error{};
  jpeg.err = jpeg_std_error(&error);
  jpeg_create_decompress(&jpeg);
  jpeg_mem_src(&jpeg, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
  jpeg_read_header(&jpeg, TRUE);
  jpeg_start_decompress(&jpeg);
  Tensor<uint8_t> pixels({jpeg.output_height, jpeg.output_width, jpeg.output_components});
  while (jpeg.output_scanline < jpeg.output_height) {
    JSAMPROW row = pixels.row(jpeg.output_scanline);
    jpeg_read_scanlines(&jpeg, &row, 1);
  }
  EXPECT_EQ(jpeg.err->num_warnings, 0);
  jpeg_finish_decompress(&jpeg);
  jpeg_destroy_decompress(&jpeg);
  return pixels;
}

// Waves of colour with a sharp edge.
Tensor<uint8_t> waves(int64_t height, int64_t width) {
  Tensor<uint8_t> pixels({height, width, 3});
  for (int64_t y = 0; y < height; ++y) {
    for (int64_t x = 0; x < width; ++x) {
      for (int64_t c = 0; c < 3; ++c) {
        const double wave = std::sin(0.05 * static_cast<double>(x * (c + 1)) + 0.08 * static_cast<double>(y));
        pixels(y, x, c) = static_cast<uint8_t>(2 * x > width + y ? 40 * c : std::lround(127 + 120 * wave));
      }
    }
  }
  return pixels;
}

double mean_error(const Tensor<uint8_t>& a, const Tensor<uint8_t>& b) {
  double sum = 0;
  for (int64_t i = 0; i < a.size(); ++i) sum += std::abs(a[i] - b[i]);
  return sum / static_cast<double>(a.size());
}

TEST(Jpeg, decodes_to_nearly_the_same_picture) {
  const Tensor<uint8_t> pixels = waves(203, 317);
  const std::string fine = jpeg_bytes(pixels, 95), coarse = jpeg_bytes(pixels, 60);
  ASSERT_EQ(decoded(fine).shape(), pixels.shape());
  EXPECT_LT(mean_error(decoded(fine), pixels), 1);
  EXPECT_LT(mean_error(decoded(coarse), pixels), 4);
  EXPECT_LT(coarse.size(), fine.size());
}

TEST(Jpeg, grey_has_one_channel) {
  Tensor<uint8_t> pixels({31, 45});
  for (int64_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<uint8_t>(i % 45 * 5);
  const Tensor<uint8_t> read = decoded(jpeg_bytes(pixels, 95));
  EXPECT_EQ(read.shape(), (Shape{31, 45, 1}));
  EXPECT_LT(mean_error(read, pixels), 1.5);
}

// Noise does not compress: the buffer grows many times.
RC_GTEST_PROP(Jpeg, any_size_and_quality_decodes, ()) {
  const int quality = *rc::gen::inRange(1, 101);
  Tensor<uint8_t> pixels({*rc::gen::inRange(1, 300), *rc::gen::inRange(1, 300), 3});
  Random random(*rc::gen::arbitrary<uint64_t>());
  for (uint8_t& v : pixels.values()) v = static_cast<uint8_t>(random.below(256));
  RC_ASSERT(decoded(jpeg_bytes(pixels, quality)).shape() == pixels.shape());
}

TEST(Jpeg, takes_the_longest_side_and_refuses_what_no_jpeg_can_be) {
  EXPECT_EQ(decoded(jpeg_bytes(Tensor<uint8_t>({1, 65500}), 80)).dim(1), 65500);
  EXPECT_EQ(decoded(jpeg_bytes(Tensor<uint8_t>({65500, 1, 3}), 80)).dim(0), 65500);
  EXPECT_THROW(jpeg_bytes(Tensor<uint8_t>({1, 65501}), 80), InputError);
  EXPECT_THROW(jpeg_bytes(Tensor<uint8_t>({65501, 1, 3}), 80), InputError);
  EXPECT_THROW(jpeg_bytes(Tensor<uint8_t>({0, 5, 3}), 80), InputError);
  EXPECT_THROW(jpeg_bytes(Tensor<uint8_t>({5, 0}), 80), InputError);
  EXPECT_THROW(jpeg_bytes(Tensor<uint8_t>({5, 5, 4}), 80), InternalError);
  EXPECT_THROW(jpeg_bytes(Tensor<uint8_t>({5, 5, 3}), 0), InternalError);
}

}  // namespace
}  // namespace traceflow
