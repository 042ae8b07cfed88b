#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <new>

#include "base/error.h"
#include "base/random.h"
#include "files/exif.h"
#include "files/jpeg.h"
#include "support/jpeg_writer.h"
#include "support/refusal.h"
#include "support/temp_folder.h"

namespace traceflow {
namespace {

InputFile file_of(const TempFolder& folder, const std::string& bytes) {
  std::ofstream(folder / "image.jpg", std::ios::binary) << bytes;
  return InputFile(folder / "image.jpg");
}

// Slow waves, which survive any kind of compression well.
std::vector<unsigned char> waves(int width, int height, int components) {
  std::vector<unsigned char> pixels;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < components; ++c) {
        pixels.push_back(
            static_cast<unsigned char>(std::lround(127 + 100 * std::sin(0.05 * x * (c + 1) + 0.06 * y))));
      }
    }
  }
  return pixels;
}

// Orientation in an EXIF segment, in either byte order, behind another entry.
std::string exif(int orientation, bool little) {
  const auto number = [&](uint32_t value, int width) {
    std::string bytes;
    for (int i = 0; i < width; ++i) {
      bytes += static_cast<char>(value >> 8 * (little ? i : width - 1 - i) & 255);
    }
    return bytes;
  };
  const std::string orientation_value = number(static_cast<uint32_t>(orientation), 2) + number(0, 2);
  return std::string("Exif\0\0", 6) + (little ? "II" : "MM") + number(42, 2) + number(10, 4) + "xx" +
         number(2, 2) +                                                      // entries, at 10
         number(0x0100, 2) + number(4, 2) + number(1, 4) + number(640, 4) +  // width
         number(0x0112, 2) + number(3, 2) + number(1, 4) + orientation_value + number(0, 4);
}

std::string refusal(const InputFile& file) {
  return refusal_of([&] { read_jpeg(file); });
}

TEST(JpegReader, every_kind_decodes_to_nearly_the_pixels_that_were_written) {
  const TempFolder folder;
  for (const bool progressive : {false, true}) {
    for (const int luma : {1, 2}) {
      for (const auto stored : {JCS_YCbCr, JCS_RGB}) {
        const JpegKind kind{stored, progressive, luma, luma == 2 && progressive ? 1 : luma, 1};
        const std::vector<unsigned char> pixels = waves(101, 67, 3);
        const InputFile file = file_of(folder, jpeg_of_kind(kind, 101, 67, 3, pixels));
        const Tensor<uint8_t> read = read_jpeg(file);
        ASSERT_EQ(read.shape(), (Shape{67, 101, 3}));
        double error = 0;
        for (int64_t i = 0; i < read.size(); ++i) error += std::abs(read[i] - pixels[static_cast<size_t>(i)]);
        EXPECT_LT(error / static_cast<double>(read.size()), 2) << progressive << luma << stored;
        const JpegSize size = read_jpeg_size(file);
        EXPECT_TRUE(size.width == 101 && size.height == 67 && size.channels == 3 && size.orientation == 1);
      }
    }
  }
}

TEST(JpegReader, grey_has_one_channel) {
  const TempFolder folder;
  const std::vector<unsigned char> pixels = waves(31, 45, 1);
  const Tensor<uint8_t> read =
      read_jpeg(file_of(folder, jpeg_of_kind({JCS_GRAYSCALE, false, 1, 1}, 31, 45, 1, pixels)));
  ASSERT_EQ(read.shape(), (Shape{45, 31, 1}));
  for (int64_t i = 0; i < read.size(); ++i) EXPECT_NEAR(read[i], pixels[static_cast<size_t>(i)], 8);
}

// Noise compresses badly: data of many times the reader's buffer.
RC_GTEST_PROP(JpegReader, reads_what_the_program_writes, ()) {
  const TempFolder folder;
  Tensor<uint8_t> pixels({*rc::gen::inRange(1, 300), *rc::gen::inRange(1, 300), 3});
  Random random(*rc::gen::arbitrary<uint64_t>());
  for (uint8_t& v : pixels.values()) v = static_cast<uint8_t>(random.below(256));
  const Tensor<uint8_t> read = read_jpeg(file_of(folder, jpeg_bytes(pixels, 100)));
  RC_ASSERT(read.shape() == pixels.shape());
  for (int64_t i = 0; i < read.size(); ++i) RC_ASSERT(std::abs(read[i] - pixels[i]) <= 6);
}

TEST(JpegReader, orientation_is_told_and_pixels_stay_as_stored) {
  const TempFolder folder;
  for (int orientation = 0; orientation <= 9; ++orientation) {
    for (const bool little : {false, true}) {
      const JpegKind kind{JCS_YCbCr, false, 2, 2, 0, {}, exif(orientation, little)};
      const InputFile file = file_of(folder, jpeg_of_kind(kind, 40, 20, 3, waves(40, 20, 3)));
      const int expected = orientation >= 1 && orientation <= 8 ? orientation : 1;
      EXPECT_EQ(read_jpeg_size(file).orientation, expected);
      EXPECT_EQ(read_jpeg(file).shape(), (Shape{20, 40, 3}));
    }
  }
}

// Two bytes say its length, their own counted.
std::string app1(const std::string& content) {
  const size_t length = content.size() + 2;
  return std::string("\xff\xe1") + static_cast<char>(length >> 8) + static_cast<char>(length & 255) + content;
}

TEST(JpegReader, the_first_segment_that_turns_the_picture_counts) {
  const TempFolder folder;
  const std::string bytes = jpeg_of_kind({}, 40, 20, 3, waves(40, 20, 3));
  const auto orientation = [&](const std::string& segments) {
    const InputFile file = file_of(folder, std::string(bytes).insert(2, segments));
    EXPECT_EQ(read_jpeg(file).shape(), (Shape{20, 40, 3}));
    return read_jpeg_size(file).orientation;
  };
  // Longer than what is read of a file at a time, together.
  const std::string other = app1("http://ns.adobe.com/xap/1.0/" + std::string(60000, 'x'));
  EXPECT_EQ(orientation(other + other), 1);
  EXPECT_EQ(orientation(other + other + app1(exif(6, true)) + other), 6);
  EXPECT_EQ(orientation(app1(exif(1, true)) + app1(exif(8, false))), 8);
  EXPECT_EQ(orientation(app1(exif(3, true)) + other + app1(exif(8, true))), 3);
  EXPECT_EQ(orientation(app1("") + app1("E") + app1(exif(2, true))), 2);
}

TEST(JpegReader, broken_exif_says_nothing) {
  const std::string whole = exif(6, true);
  EXPECT_EQ(exif_orientation(std::as_bytes(std::span(whole))), 6);
  for (size_t at = 0; at < whole.size(); ++at) {
    EXPECT_GE(exif_orientation(std::as_bytes(std::span(whole).first(at))), 1);
    for (int value = 0; value < 256; value += 5) {
      std::string broken = whole;
      broken[at] = static_cast<char>(value);
      const int orientation = exif_orientation(std::as_bytes(std::span(broken)));
      EXPECT_TRUE(orientation >= 1 && orientation <= 8);
    }
  }
}

TEST(JpegReaderHostile, every_truncation_is_refused) {
  const TempFolder folder;
  for (const bool progressive : {false, true}) {
    const std::string bytes = jpeg_of_kind({JCS_YCbCr, progressive}, 33, 21, 3, waves(33, 21, 3));
    for (size_t length = 0; length < bytes.size(); ++length) {
      const std::string line = refusal(file_of(folder, bytes.substr(0, length)));
      EXPECT_NE(line.find("image.jpg"), std::string::npos) << length;
    }
    EXPECT_EQ(refusal(file_of(folder, bytes)), "accepted");
  }
}

TEST(JpegReaderHostile, missing_data_in_the_middle_are_refused) {
  const TempFolder folder;
  const std::string bytes = jpeg_of_kind({}, 64, 64, 3, waves(64, 64, 3));
  const std::string line = refusal(file_of(folder, bytes.substr(0, bytes.size() - 200) + "\xff\xd9"));
  EXPECT_NE(line.find("premature end"), std::string::npos) << line;
}

TEST(JpegReaderHostile, every_flipped_byte_is_refused_or_read) {
  const TempFolder folder;
  for (const bool progressive : {false, true}) {
    const std::string bytes = jpeg_of_kind({JCS_YCbCr, progressive}, 33, 21, 3, waves(33, 21, 3));
    for (size_t at = 0; at < bytes.size(); ++at) {
      std::string broken = bytes;
      broken[at] = static_cast<char>(broken[at] ^ 0x55);
      try {
        EXPECT_FALSE(read_jpeg(file_of(folder, broken)).empty());
      } catch (const InputError&) {
      }
    }
  }
}

TEST(JpegReaderHostile, the_colours_of_print_are_refused_by_name) {
  const TempFolder folder;
  for (const auto stored : {JCS_CMYK, JCS_YCCK}) {
    const JpegKind kind{stored, false, 1, 1};
    const InputFile file = file_of(folder, jpeg_of_kind(kind, 8, 8, 4, waves(8, 8, 4)));
    EXPECT_NE(refusal(file).find("CMYK"), std::string::npos);
    EXPECT_THROW(read_jpeg_size(file), InputError);
  }
  const InputFile two = file_of(folder, jpeg_of_kind({JCS_UNKNOWN, false, 1, 1}, 8, 8, 2, waves(8, 8, 2)));
  EXPECT_NE(refusal(two).find("2 colour components"), std::string::npos);
}

// The header's height and width stand behind the marker SOF0 (ff c0; of a progressive one SOF2, ff c2), two
// bytes of length and one of depth.
std::string with_size(std::string bytes, int width, int height, const char* marker = "\xff\xc0") {
  const size_t at = bytes.find(marker) + 5;
  bytes[at] = static_cast<char>(height >> 8);
  bytes[at + 1] = static_cast<char>(height & 255);
  bytes[at + 2] = static_cast<char>(width >> 8);
  bytes[at + 3] = static_cast<char>(width & 255);
  return bytes;
}

TEST(JpegReaderHostile, huge_headers_are_refused_before_memory_is_taken) {
  const TempFolder folder;
  const std::string bytes = jpeg_of_kind({}, 8, 8, 3, waves(8, 8, 3));
  const InputFile large = file_of(folder, with_size(bytes, 32768, 8192));
  EXPECT_EQ(read_jpeg_size(large).width, 32768);
  EXPECT_NE(refusal(large).find("too short for an image of 32768×8192"), std::string::npos);
  EXPECT_THROW(read_jpeg_size(file_of(folder, with_size(bytes, 32768, 8193))), InputError);
  EXPECT_THROW(read_jpeg_size(file_of(folder, with_size(bytes, 32769, 8))), InputError);
  EXPECT_THROW(read_jpeg_size(file_of(folder, with_size(bytes, 0, 8))), InputError);
}

TEST(JpegReaderHostile, several_scans_may_have_half_as_many_pixels) {
  const TempFolder folder;
  const std::string bytes = jpeg_of_kind({JCS_YCbCr, true}, 8, 8, 3, waves(8, 8, 3));
  const auto sized = [&](int width, int height) {
    return file_of(folder, with_size(bytes, width, height, "\xff\xc2"));
  };
  EXPECT_EQ(read_jpeg_size(sized(16384, 8192)).width, 16384);
  EXPECT_NE(refusal(sized(16384, 8193)).find("16384×8193 in several scans"), std::string::npos);
}

// Of the process, by the system: libjpeg asks malloc.
[[noreturn]] void read_with_room_for(const InputFile& file, int64_t bytes) {
  int64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  const auto limit = static_cast<rlim_t>(pages * sysconf(_SC_PAGESIZE) + bytes);
  const rlimit room{limit, limit};
  if (setrlimit(RLIMIT_AS, &room) != 0) std::_Exit(1);
  try {
    read_jpeg(file);
  } catch (const std::bad_alloc&) {
    std::_Exit(4);
  } catch (const InputError&) {
    std::_Exit(2);
  }
  std::_Exit(0);
}

// A sanitizer's shadow memory takes all room.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool can_limit_room = false;
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
constexpr bool can_limit_room = false;
#else
constexpr bool can_limit_room = true;
#endif
#else
constexpr bool can_limit_room = true;
#endif

TEST(JpegReaderHostile, memory_refused_is_no_fault_of_the_file) {
  if (!can_limit_room) GTEST_SKIP() << "a sanitizer's shadow memory takes all room";
  // In a program that has run no other test: what those have given back is room.
  testing::GTEST_FLAG(death_test_style) = "threadsafe";
  const TempFolder folder;
  constexpr int side = 4096;  // 16 MiB of pixels, 32 MiB of coefficients
  const std::string bytes = jpeg_of_kind({JCS_GRAYSCALE, true, 1, 1}, side, side, 1,
                                         std::vector<unsigned char>(size_t{side} * side, 90));
  const InputFile file = file_of(folder, bytes);
  EXPECT_EXIT(read_with_room_for(file, int64_t{32} << 20), testing::ExitedWithCode(4), "");
  EXPECT_EXIT(read_with_room_for(file, int64_t{256} << 20), testing::ExitedWithCode(0), "");
}

TEST(JpegReaderHostile, segments_without_end_take_no_memory) {
  if (!can_limit_room) GTEST_SKIP() << "a sanitizer's shadow memory takes all room";
  testing::GTEST_FLAG(death_test_style) = "threadsafe";
  const TempFolder folder;
  const std::string bytes = jpeg_of_kind({}, 8, 8, 3, waves(8, 8, 3));
  const std::string segment = app1(std::string(65000, 'x'));
  {
    std::ofstream out(folder / "image.jpg", std::ios::binary);
    out << bytes.substr(0, 2);
    for (int i = 0; i < 512; ++i) out << segment;
    out << bytes.substr(2);
  }
  const InputFile file(folder / "image.jpg");
  EXPECT_EQ(file.size(), static_cast<int64_t>(bytes.size() + 512 * segment.size()));
  EXPECT_EXIT(read_with_room_for(file, int64_t{16} << 20), testing::ExitedWithCode(0), "");
}

// A flat picture takes the least room that there is: it must not be taken for a bomb.
TEST(JpegReaderHostile, a_flat_picture_is_not_refused) {
  const TempFolder folder;
  for (const bool progressive : {false, true}) {
    for (const int luma : {1, 2, 4}) {
      const JpegKind kind{JCS_YCbCr, progressive, luma, luma == 4 ? 1 : luma};
      const std::vector<unsigned char> flat(size_t{3} * 2048 * 1024, 0);
      EXPECT_EQ(refusal(file_of(folder, jpeg_of_kind(kind, 2048, 1024, 3, flat))), "accepted");
    }
  }
}

// Bit by bit of coefficient by coefficient.
TEST(JpegReaderHostile, hundreds_of_scans_are_refused) {
  const TempFolder folder;
  for (const int last_bit : {5, 0}) {
    JpegKind kind{JCS_GRAYSCALE, false, 1, 1};
    kind.scans.push_back({1, {0, 0, 0, 0}, 0, 0, 0, 0});
    for (int bit = 9; bit >= last_bit; --bit) {
      for (int k = 1; k < 64; ++k) kind.scans.push_back({1, {0, 0, 0, 0}, k, k, bit == 9 ? 0 : bit + 1, bit});
    }
    const std::string line = refusal(file_of(folder, jpeg_of_kind(kind, 8, 8, 1, waves(8, 8, 1))));
    EXPECT_EQ(line.find("more than 500 scans") != std::string::npos, kind.scans.size() > 500) << line;
    EXPECT_EQ(line == "accepted", kind.scans.size() <= 500) << line;
  }
}

}  // namespace
}  // namespace traceflow
