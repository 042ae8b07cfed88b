#include "train/odd_masks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "files/png.h"
#include "train/small_run.h"

namespace traceflow {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<MaskExtent> extents(const std::vector<double>& shares, const std::set<size_t>& at_edge = {}) {
  std::vector<MaskExtent> result;
  for (size_t i = 0; i < shares.size(); ++i)
    result.push_back({std::to_string(i), shares[i], at_edge.contains(i)});
  return result;
}

TEST(OddMasks, AreThoseThatTheTimesBesideThemContradict) {
  EXPECT_THAT(odd_extents(extents({.2, .2, 0, .2, .2})), ElementsAre(2));
  EXPECT_THAT(odd_extents(extents({.2, .2, 1, .2, .2})), ElementsAre(2));
  EXPECT_THAT(odd_extents(extents({.2, .2, .1, .2, .2})), ElementsAre(2));  // half of it
  EXPECT_THAT(odd_extents(extents({0, 0, .2, .2, .2})), ElementsAre(0, 1));
  EXPECT_THAT(odd_extents(extents({.2, 0, .2, 0, .2, 0, .2})), ElementsAre(1, 3, 5));
}

TEST(OddMasks, AreNotThoseOfWhatGrowsOrLeavesThePicture) {
  EXPECT_THAT(odd_extents(extents({.1, .13, .17, .22, .29, .37, .48})), IsEmpty());
  EXPECT_THAT(odd_extents(extents({.2, .2, .16, .1, .04, 0, 0, 0}, {2, 3, 4})), IsEmpty());
  EXPECT_THAT(odd_extents(extents({0, 0, .04, .1, .16, .2, .2}, {2, 3, 4})), IsEmpty());
  // At the edge all the time: its masks still do not vanish at once.
  EXPECT_THAT(odd_extents(extents({.2, .2, 0, .2, .2}, {0, 1, 3, 4})), ElementsAre(2));
  EXPECT_THAT(odd_extents(extents({0, 0, 0})), IsEmpty());
  EXPECT_THAT(odd_extents(extents({.2, 0})), IsEmpty());
  EXPECT_THAT(odd_extents({}), IsEmpty());
}

TEST(OddMasks, AreTakenFromTheirViewsWithAWarning) {
  const fs::path folder = fs::path(::testing::TempDir()) / ("odd_masks_" + std::to_string(::getpid()));
  fs::copy(capture_folder(), folder, fs::copy_options::recursive);
  Capture capture = load_capture(folder, {});
  ASSERT_GE(capture.train.size(), 3U);
  const auto warned = capture.warnings.size();
  leave_out_odd_masks(capture);
  EXPECT_EQ(capture.warnings.size(), warned);
  const View& odd = capture.train[1];
  const Tensor<uint8_t> mask = load_images(capture, odd)->mask;
  write_png(folder / "mask/1x" / (odd.id + ".png.png"), Tensor<uint8_t>(mask.shape()));
  capture = load_capture(folder, {});
  leave_out_odd_masks(capture);
  for (const View& view : capture.train)
    EXPECT_EQ(load_images(capture, view)->mask.empty(), view.id == odd.id) << view.id;
  ASSERT_EQ(capture.warnings.size(), warned + 1);
  EXPECT_EQ(capture.warnings.back().kind, "mask-odd");
  EXPECT_THAT(capture.warnings.back().views, ElementsAre(odd.id));
}

}  // namespace
}  // namespace traceflow
