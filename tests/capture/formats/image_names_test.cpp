#include "capture/formats/image_names.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>

#include "base/error.h"
#include "support/temp_folder.h"

namespace traceflow {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::string in_x(size_t) { return "x"; }

TEST(ImageNames, digits_compare_as_numbers) {
  const std::vector<std::string> sorted = {"",
                                           "1",
                                           "01",
                                           "2",
                                           "10",
                                           "a",
                                           "a1b",
                                           "a01c",
                                           "a2",
                                           "a10",
                                           "a10b1",
                                           "a10b02",
                                           "a10b12",
                                           "b",
                                           "img_9",
                                           "img_10",
                                           "img_0011",
                                           "r",
                                           "r_99999999999999999999999",
                                           "r_199999999999999999999999"};
  for (size_t i = 0; i < sorted.size(); ++i) {
    for (size_t j = 0; j < sorted.size(); ++j) {
      // "01" and "1" are the same number: they differ, in one way.
      if (i < 3 && j < 3 && i > 0 && j > 0 && i != j) {
        EXPECT_NE(natural_less(sorted[i], sorted[j]), natural_less(sorted[j], sorted[i]));
      } else {
        EXPECT_EQ(natural_less(sorted[i], sorted[j]), i < j) << sorted[i] << " " << sorted[j];
      }
    }
  }
}

TEST(ImageNames, ids_drop_what_all_share_and_the_extension) {
  EXPECT_THAT(image_ids({"images/a.png", "images/left/b.c.jpg"}, in_x), ElementsAre("a", "left_b.c"));
  EXPECT_THAT(image_ids({"train/r_0", "test/r_0"}, in_x), ElementsAre("train_r_0", "test_r_0"));
  EXPECT_THAT(image_ids({"images/10.png", "images/1.png"}, in_x), ElementsAre("10", "1"));
  EXPECT_THAT(image_ids({"images/a.png"}, in_x), ElementsAre("a"));
  EXPECT_THAT(image_ids({}, in_x), ElementsAre());
  // Fractions of seconds are no extensions; those of pictures that somebody converted are.
  EXPECT_THAT(image_ids({"train/1616.12", "train/1616.34"}, in_x), ElementsAre("1616.12", "1616.34"));
  EXPECT_THAT(image_ids({"a/1.5.TIF", "a/1.6.png"}, in_x), ElementsAre("1.5", "1.6"));
}

TEST(ImageNames, ids_that_cannot_name_a_file_or_collide_are_refused) {
  const std::pair<std::vector<std::string>, const char*> cases[] = {
      {{"a.png", "a.jpg"}, "found a.png and a.jpg"},
      {{"a/b.png", "a_b.png"}, "found a/b.png and a_b.png"},
      {{"a/..", "b"}, "found \"a/..\""},
      {{"..", "b"}, "found \"..\""},
      {{"", "b"}, "found \"\""}};
  for (const auto& [paths, expected] : cases) {
    try {
      image_ids(paths, [](size_t i) { return "images.bin " + std::to_string(i); });
      if (paths[0] != "a/..") ADD_FAILURE() << expected;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(": image names"));
      EXPECT_THAT(error.what(), HasSubstr(expected));
      EXPECT_EQ(std::string(error.what()).starts_with("images.bin 0"), paths[0] == ".." || paths[0].empty());
    }
  }
}

TEST(ImageNames, times_follow_names_and_cameras_side_by_side_share_them) {
  EXPECT_THAT(times_by_names({"10.png", "9.png", "1.png"}), ElementsAre(2, 1, 0));
  EXPECT_THAT(times_by_names({"left/1.png", "left/2.png", "right/1.png", "right/2.png"}),
              ElementsAre(0, 1, 0, 1));
  EXPECT_THAT(times_by_names({"left/1.png", "right/1.jpg"}), ElementsAre(0, 0));
  // Others have places too.
  EXPECT_THAT(times_by_names({"a/99.png", "a/200.png"}, {"a/100.png", "a/101.jpg", "a/99", "b/300"}),
              ElementsAre(0, 3));
}

TEST(ImageNames, images_are_found_with_another_extension) {
  const TempFolder folder;
  for (const char* name : {"a.png", "b.JPG", "v1.5.jpg", "v1.png", "c.d.png", "c.tif.png"})
    std::ofstream(folder / name) << "x";
  const auto tree = FileTree::open(folder.path());
  EXPECT_EQ(find_image(*tree, "a.png"), "a.png");
  EXPECT_EQ(find_image(*tree, "a.jpg"), "a.png");
  EXPECT_EQ(find_image(*tree, "b"), "b.JPG");
  EXPECT_EQ(find_image(*tree, "v1.5"), "v1.5.jpg");
  EXPECT_EQ(find_image(*tree, "v1.6"), "");
  EXPECT_EQ(find_image(*tree, "c.d"), "c.d.png");
  EXPECT_EQ(find_image(*tree, "c.tif"), "c.tif.png");
  EXPECT_EQ(find_image(*tree, "a.tif"), "a.png");
  EXPECT_EQ(find_image(*tree, "c.png"), "");
  EXPECT_EQ(find_image(*tree, "../a.png"), "");
}

}  // namespace
}  // namespace traceflow
