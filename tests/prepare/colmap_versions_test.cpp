#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "base/process.h"
#include "capture/capture.h"
#include "files/png.h"
#include "prepare/poses.h"
#include "prepare/prepare_case.h"
#include "support/file_bytes.h"

namespace traceflow::prepare {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

// The whole of `prepare` with COLMAP as versions before 3.13 speak, and as those from then on do.
class ColmapVersions : public PrepareTest, public testing::WithParamInterface<std::string> {
 protected:
  ColmapVersions() { set_variable("COLMAP", GetParam()); }

  static bool is_new() { return GetParam() == "4.1"; }
  bool accepts(const std::string& verb, const std::string& option) const {
    const Descriptor log = open_log(folder_ / "accepts.log");
    return Process({"colmap", verb, "--database_path", folder_ / "accepts.db", option, "0"},
                   {.error = log.number()})
        .wait();
  }
};

INSTANTIATE_TEST_SUITE_P(Of, ColmapVersions, testing::Values("3.8", "4.1"), [](const auto& version) {
  return version.param == "4.1" ? std::string("from_3_13_on") : std::string("before_3_13");
});

TEST_P(ColmapVersions, EndInACapture) {
  // From 3.12 on these lie beside the model.
  for (const char* name : {"rigs.bin", "frames.bin"})
    write_bytes(folder_ / "model" / name, std::string(8, '\0'));
  PrepareOptions some = options();
  some.masks = write_masks(64, 40);
  some.matcher = Matcher::sequential;
  ASSERT_TRUE(prepare(some));
  const std::string called = bytes_of(folder_ / "calls"), kind = is_new() ? "Feature" : "Sift";
  EXPECT_THAT(called, AllOf(HasSubstr("--" + kind + "Extraction.use_gpu 0"),
                            HasSubstr("--" + kind + "Extraction.num_threads "),
                            HasSubstr("--" + kind + "Matching.use_gpu 0"),
                            HasSubstr("--" + kind + "Matching.num_threads ")));
  EXPECT_EQ(load_capture(capture(), {}).train.size(), 11U);
  some.matcher = Matcher::exhaustive;
  ASSERT_TRUE(prepare(some));
  EXPECT_THAT(calls(), ElementsAre("colmap exhaustive_matcher", "colmap mapper"));
  EXPECT_EQ(load_capture(capture(), {}).train.size(), 11U);
}

TEST_P(ColmapVersions, ThatRegisterNothingSayWhatToTry) {
  set_variable("FAIL", "mapper");
  EXPECT_THAT(refusal(options()), AllOf(HasSubstr("0 of 14 frames registered (colmap mapper: "),
                                        HasSubstr(is_new() ? "Failed to create any sparse model)"
                                                           : "ERROR: failed to create sparse model)"),
                                        HasSubstr("try more frames")));
}

TEST_P(ColmapVersions, TakeFeaturesEverywhereInAFrameWithoutAMask) {
  PrepareOptions two = options();
  two.test_video = folder_ / "second.mp4";
  two.masks = write_masks(64, 40);
  two.until = Step::features;
  for (const char* ending : {"", ".ppm", ".pgm", ".times"})
    fs::copy(film() + ending, two.test_video + ending);
  ASSERT_TRUE(prepare(two));
  const fs::path masks = work_folder(capture()) / "colmap/masks";
  const Tensor<uint8_t> masked = read_png(masks / "000002_left.png.png"),
                        free = read_png(masks / "000002_right.png.png");
  EXPECT_EQ(masked(20, 10, 0), 0);
  EXPECT_EQ(masked(20, 50, 0), 255);
  EXPECT_EQ(free.shape(), masked.shape());
  EXPECT_TRUE(std::all_of(free.data(), free.data() + free.size(), [](uint8_t v) { return v == 255; }));
}

// As played by the script of these tests.
TEST_P(ColmapVersions, RefuseTheOptionsOfOthers) {
  EXPECT_TRUE(
      accepts("feature_extractor", is_new() ? "--FeatureExtraction.use_gpu" : "--SiftExtraction.use_gpu"));
  EXPECT_FALSE(
      accepts("feature_extractor", is_new() ? "--SiftExtraction.use_gpu" : "--FeatureExtraction.use_gpu"));
  EXPECT_TRUE(
      accepts("exhaustive_matcher", is_new() ? "--FeatureMatching.use_gpu" : "--SiftMatching.use_gpu"));
  EXPECT_FALSE(
      accepts("exhaustive_matcher", is_new() ? "--SiftMatching.use_gpu" : "--FeatureMatching.use_gpu"));
  EXPECT_FALSE(accepts("exhaustive_matcher", "--SequentialMatching.overlap"));
  EXPECT_THAT(bytes_of(folder_ / "accepts.log"),
              HasSubstr("Failed to parse options - unrecognised option '--SequentialMatching.overlap'"));
}

TEST_P(ColmapVersions, ThatSayNothingOfAGpuAreRefused) {
  set_variable("FAIL", "help");
  EXPECT_THAT(refusal(options()), AllOf(HasSubstr("colmap feature_extractor: help: found no option use_gpu"),
                                        HasSubstr("COLMAP 3.8 or later"), HasSubstr("help.log")));
}

TEST(ShareSaid, IsWhatColmapSaysLast) {
  const auto said = [](const std::string& text) {
    const auto share = share_said(text, 87);
    return share ? fmt::format("{}/{}", share->done, share->all) : "nothing";
  };
  EXPECT_EQ(
      said("Processed file [1/87]\n  Name: 000000.png\nI2024 17 x.cc:9] Processed file [12/87]\n  Name:"),
      "12/87");
  EXPECT_EQ(said("Matching image [9/87] in 0.551s\nMatching image [10/87]"), "10/87");
  EXPECT_EQ(said("Matching block [2/3, 1/3] in 0.5s"), "4/9");
  EXPECT_EQ(said("Registering image #59 (36)\n\n  => Image sees 312 / 512 points"), "36/87");
  const std::string log = "I20260717 10:20:30.405060 7 file.cc:80] ";
  EXPECT_EQ(said(log + "Processing image [9/87]\n" + log + "Processing image [10/87]\n"), "10/87");
  EXPECT_EQ(said(log + "Processing block [2/3, 1/3]\n" + log + "in 0.500s"), "4/9");
  EXPECT_EQ(
      said(log + "Registering image #59 (num_reg_frames=36)\n" + log + "=> Image sees 312 / 512 points"),
      "36/87");
  EXPECT_EQ(said("tching image [9/8"), "nothing");
  EXPECT_EQ(said(""), "nothing");
}

}  // namespace
}  // namespace traceflow::prepare
