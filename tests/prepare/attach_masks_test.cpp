#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <memory>
#include <tuple>

#include "base/descriptor.h"
#include "base/error.h"
#include "base/process.h"
#include "capture/capture.h"
#include "capture/synth/synth.h"
#include "files/jpeg.h"
#include "files/png.h"
#include "prepare/attach_priors.h"
#include "prepare/mask_coding.h"
#include "prepare/programs.h"
#include "support/file_bytes.h"
#include "support/refusal.h"
#include "support/temp_folder.h"

// Masks as other programs write them.
namespace traceflow::prepare {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr int64_t mask_width = 80, mask_height = 48;

// A PNG of indexed colours, written after the format's description.
std::string palette_png(const Tensor<uint8_t>& labels, const std::string& palette) {
  const auto number = [](uint64_t value) {
    std::string bytes;
    for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift & 0xff);
    return bytes;
  };
  const auto chunk = [&](const std::string& name, const std::string& data) {
    const std::string named = name + data;
    return number(data.size()) + named +
           number(crc32(0, reinterpret_cast<const Bytef*>(named.data()), static_cast<uInt>(named.size())));
  };
  std::string rows;
  for (int64_t y = 0; y < labels.dim(0); ++y) {
    rows += '\0';  // no filter
    rows.append(reinterpret_cast<const char*>(labels.row(y)), static_cast<size_t>(labels.dim(1)));
  }
  uLongf size = compressBound(rows.size());
  std::string packed(size, '\0');
  compress(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(rows.data()),
           rows.size());
  packed.resize(size);
  const std::string header = number(static_cast<uint64_t>(labels.dim(1))) +
                             number(static_cast<uint64_t>(labels.dim(0))) + std::string("\x08\x03\0\0\0", 5);
  return "\x89PNG\r\n\x1a\n" + chunk("IHDR", header) + chunk("PLTE", palette) + chunk("IDAT", packed) +
         chunk("IEND", "");
}

class AttachMasks : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    made = std::make_unique<TempFolder>();
    SynthOptions options;
    options.frames = 5;
    options.width = mask_width;
    options.height = mask_height;
    options.samples = 1;
    options.points = 400;
    write_synthetic_capture(options, *made / "capture");
    for (const View& view : load_capture(*made / "capture", {}).train) ids.push_back(view.id);
  }
  static void TearDownTestSuite() { made.reset(); }

  void SetUp() override {
    if (!is_in_path("ffmpeg")) GTEST_SKIP() << "masks need ffmpeg";
    fs::copy(*made / "capture", folder_ / "capture", fs::copy_options::recursive);
    fs::create_directory(given());
  }

  fs::path given() const { return folder_ / "given"; }
  // 0 and 1.
  static Tensor<uint8_t> truth(const std::string& id) {
    Tensor<uint8_t> mask({mask_height, mask_width});
    const Tensor<uint8_t> stored = read_png(*made / "capture/mask/1x" / (id + ".png.png"));
    for (int64_t i = 0; i < mask.size(); ++i) mask[i] = stored[i] >= 128 ? 1 : 0;
    return mask;
  }
  // The moving pixels as 1 in the left half of the picture and 2 in the right.
  static Tensor<uint8_t> two_labels(const std::string& id) {
    Tensor<uint8_t> labels = truth(id);
    for (int64_t i = 0; i < labels.size(); ++i) {
      if (i % mask_width >= mask_width / 2) labels[i] = static_cast<uint8_t>(2 * labels[i]);
    }
    return labels;
  }
  // As the values `still` and `moving`.
  static Tensor<uint8_t> two_levels(const std::string& id, uint8_t still, uint8_t moving) {
    Tensor<uint8_t> picture = truth(id);
    for (uint8_t& v : picture.values()) v = v != 0 ? moving : still;
    return picture;
  }

  std::string attach(const fs::path& masks, MaskWhite white = MaskWhite::automatic) {
    AttachOptions options;
    options.masks = masks;
    options.mask_white = white;
    options.force = true;
    std::string said;
    attach_priors(
        folder_ / "capture", options, [&](const std::string& line) { said += line + "\n"; }, never_);
    return said;
  }

  // Of all training views, the pixels that are not as in the truth.
  double wrong_share() const {
    int64_t wrong = 0, all = 0;
    for (const std::string& id : ids) {
      const Tensor<uint8_t> found = read_png(folder_ / "capture/mask/1x" / (id + ".png.png")),
                            expected = truth(id);
      for (int64_t i = 0; i < expected.size(); ++i) wrong += found[i] != (expected[i] != 0 ? 255 : 0) ? 1 : 0;
      all += expected.size();
    }
    return static_cast<double>(wrong) / static_cast<double>(all);
  }

  static std::unique_ptr<TempFolder> made;
  static std::vector<std::string> ids;
  TempFolder folder_;
  const std::atomic<bool> never_ = false;
};
std::unique_ptr<TempFolder> AttachMasks::made;
std::vector<std::string> AttachMasks::ids;

// As SAM 2 writes them: red is darker than half grey.
TEST_F(AttachMasks, EachColourOfAPaletteMoves) {
  for (const std::string& id : ids) {
    write_bytes(given() / (id + ".png"),
                palette_png(two_labels(id), std::string("\0\0\0\x80\0\0\0\x80\0", 9)));
  }
  EXPECT_THAT(attach(given()), HasSubstr("palette of 3 colours: all but black assumed moving)"));
  EXPECT_EQ(wrong_share(), 0);
}

TEST_F(AttachMasks, EachNumberOfAnObjectMoves) {
  for (const std::string& id : ids) write_png(given() / (id + ".png"), two_labels(id));
  EXPECT_THAT(attach(given()), HasSubstr("(labels 0 to 2: all but 0 assumed moving)"));
  EXPECT_EQ(wrong_share(), 0);
  for (const std::string& id : ids) write_png(given() / (id + ".png"), truth(id));
  EXPECT_THAT(attach(given()), HasSubstr("(labels 0 to 1: all but 0 assumed moving)"));
  EXPECT_EQ(wrong_share(), 0);
}

TEST_F(AttachMasks, BlackMovesWhereWhiteIsAllAround) {
  for (const std::string& id : ids) write_png(given() / (id + ".png"), two_levels(id, 255, 0));
  EXPECT_THAT(attach(given()), HasSubstr("(white assumed static: it covers 1"));  // 100% of the border
  EXPECT_EQ(wrong_share(), 0);
  EXPECT_THAT(attach(given(), MaskWhite::moving), HasSubstr("(white moving, as asked)"));
  EXPECT_EQ(wrong_share(), 1);
  EXPECT_THAT(attach(given(), MaskWhite::static_scene), HasSubstr("(white static, as asked)"));
  EXPECT_EQ(wrong_share(), 0);
  for (const std::string& id : ids) write_png(given() / (id + ".png"), two_levels(id, 1, 0));
  EXPECT_THAT(attach(given()), HasSubstr("(labels 0 to 1: all but 0 assumed static: it covers 1"));
  EXPECT_EQ(wrong_share(), 0);
}

TEST_F(AttachMasks, JpegFilesHaveNoisyEdges) {
  for (const auto& [still, moving, said] : {std::tuple{0, 255, "(white assumed moving)"},
                                            std::tuple{255, 0, "(white assumed static: it covers"}}) {
    for (const std::string& id : ids) {
      const Tensor<uint8_t> grey = two_levels(id, static_cast<uint8_t>(still), static_cast<uint8_t>(moving));
      Tensor<uint8_t> picture({mask_height, mask_width, 3});
      for (int64_t i = 0; i < picture.size(); ++i) picture[i] = grey[i / 3];
      write_bytes(given() / (id + ".jpg"), jpeg_bytes(picture, 75));
    }
    EXPECT_THAT(attach(given()), HasSubstr(said));
    EXPECT_LT(wrong_share(), 0.01);
  }
}

TEST_F(AttachMasks, FilmsAreReadInOrder) {
  for (size_t i = 0; i < ids.size(); ++i)
    write_png(given() / (std::to_string(i) + ".png"), two_levels(ids[i], 255, 0));
  const Descriptor log = open_log(folder_ / "make.log");
  ASSERT_TRUE(Process({"ffmpeg", "-nostdin", "-i", given() / "%d.png", "-c:v", "mpeg4", "-q:v", "2",
                       folder_ / "masks.mp4"},
                      {.error = log.number()})
                  .wait());
  EXPECT_THAT(attach(folder_ / "masks.mp4"), HasSubstr("(white assumed static"));
  EXPECT_LT(wrong_share(), 0.01);
}

TEST_F(AttachMasks, WhatIsNoMaskIsRefused) {
  const auto refusal = [&] { return refusal_of([&] { attach(given()); }); };
  for (const std::string& id : ids) fs::copy(*made / "capture/rgb/1x" / (id + ".png"), given());
  EXPECT_THAT(refusal(),
              HasSubstr("masks: found more than 256 colours, expected white and black, or labels"));
  for (const std::string& id : ids) write_png(given() / (id + ".png"), two_levels(id, 0, 0));
  EXPECT_THAT(refusal(), HasSubstr("masks: found nothing that moves in any"));
  const std::string no_black("\xff\xff\xff\x80\0\0\0\x80\0", 9);
  for (const std::string& id : ids)
    write_bytes(given() / (id + ".png"), palette_png(two_labels(id), no_black));
  EXPECT_THAT(refusal(), HasSubstr("masks: found 3 colours and no black background"));
  Tensor<uint8_t> ramp({mask_height, mask_width});
  for (int64_t i = 0; i < ramp.size(); ++i) ramp[i] = static_cast<uint8_t>(64 + i % mask_width);
  for (const std::string& id : ids) write_png(given() / (id + ".png"), ramp);
  EXPECT_THAT(refusal(), HasSubstr("masks: found 100% of the pixels neither black nor white"));
}

// A rectangle of objects anywhere, seen either way round, is the same mask.
TEST(MaskCoding, PolarityIsFoundForObjectsOfEachPlaceAndSize) {
  int64_t tried = 0;
  for (const int64_t left : {0, 4, 20}) {
    for (const int64_t top : {4, 10}) {
      for (const int64_t width : {6, 20, 40}) {
        for (const int64_t height : {6, 20, 30}) {
          Tensor<uint8_t> object({mask_height, mask_width, 3}), inverse = object;
          for (int64_t y = 0; y < mask_height; ++y) {
            for (int64_t x = 0; x < mask_width; ++x) {
              const bool is_object = x >= left && x < left + width && y >= top && y < top + height;
              for (int64_t c = 0; c < 3; ++c) {
                object(y, x, c) = is_object ? 255 : 0;
                inverse(y, x, c) = is_object ? 0 : 255;
              }
            }
          }
          MaskStatistics of_object, of_inverse;
          of_object.add(object);
          of_inverse.add(inverse);
          const MaskCoding usual = find_coding(of_object, true, MaskWhite::automatic, "m"),
                           other = find_coding(of_inverse, true, MaskWhite::automatic, "m");
          EXPECT_TRUE(usual.white_moves);
          // A small object at the border hides as much of it as of the inside.
          if (left == 0 && width == 6) continue;
          EXPECT_FALSE(other.white_moves) << left << " " << top << " " << width << " " << height;
          const Tensor<uint8_t> a = decoded_mask(object, usual), b = decoded_mask(inverse, other);
          EXPECT_TRUE(std::equal(a.data(), a.data() + a.size(), b.data()));
          ++tried;
        }
      }
    }
  }
  EXPECT_EQ(tried, 48);
}

// Most of the pictures and, unlike what stands still behind an object, little of their border.
TEST(MaskCoding, ALargeObjectInWhiteMoves) {
  Tensor<uint8_t> picture({mask_height, mask_width, 3});
  for (int64_t y = 4; y < mask_height; ++y) std::fill_n(&picture(y, 6, 0), 3 * (mask_width - 12), 255);
  MaskStatistics statistics;
  statistics.add(picture);
  const MaskCoding coding = find_coding(statistics, true, MaskWhite::automatic, "m");
  EXPECT_TRUE(coding.white_moves);
  EXPECT_THAT(coding.text,
              testing::ContainsRegex("white assumed moving, though it covers .*--mask-white static"));
}

// Soft edges are darker than half grey too.
TEST(MaskCoding, EdgesAreNoLabels) {
  Tensor<uint8_t> picture({mask_height, mask_width, 3});
  for (int64_t y = 8; y < 40; ++y) {
    std::fill_n(&picture(y, 19, 0), 3 * 42, 100);
    std::fill_n(&picture(y, 20, 0), 3 * 40, 255);
  }
  MaskStatistics statistics;
  statistics.add(picture);
  EXPECT_EQ(find_coding(statistics, true, MaskWhite::automatic, "m").kind, MaskCoding::Kind::shades);
}

// Objects 1 and 200, and numbers that JPEG files cannot hold.
TEST(MaskCoding, LabelsMayBeAsBrightAsWhite) {
  Tensor<uint8_t> picture({mask_height, mask_width, 3});
  for (int64_t y = 8; y < 40; ++y) {
    std::fill_n(&picture(y, 10, 0), 3 * 20, 1);
    std::fill_n(&picture(y, 40, 0), 3 * 20, 200);
  }
  MaskStatistics statistics;
  statistics.add(picture);
  EXPECT_EQ(find_coding(statistics, true, MaskWhite::automatic, "m").kind, MaskCoding::Kind::labels);
  EXPECT_EQ(find_coding(statistics, false, MaskWhite::automatic, "m").kind, MaskCoding::Kind::shades);
}

}  // namespace
}  // namespace traceflow::prepare
