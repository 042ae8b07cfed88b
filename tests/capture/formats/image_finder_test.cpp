#include "capture/formats/image_finder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "capture/formats/image_names.h"
#include "support/refusal.h"
#include "support/temp_folder.h"
#include "support/zip_writer.h"

namespace traceflow {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pair;

using Names = std::vector<std::string>;

TEST(ImageFinder, finds_what_is_found_without_it) {
  const Names files = {"a.png",           "b.tif.JPG",
                       "images/a.png",    "images/left/b.JPG",
                       "images/v1.5.jpg", "images/left/in/c.png",
                       "images_2/a.jpg",  "notes/a.txt"};
  const TempFolder folder;
  std::vector<std::pair<std::string, std::string>> members;
  for (const std::string& file : files) {
    std::filesystem::create_directories((folder / "tree" / file).parent_path());
    std::ofstream(folder / "tree" / file) << "x";
    members.emplace_back(file, "x");
  }
  std::ofstream(folder / "a.zip", std::ios::binary) << zip_archive(members, false);
  std::filesystem::create_directory_symlink("images", folder / "tree/linked");
  int found = 0;
  for (const char* where : {"tree", "a.zip"}) {
    const auto tree = FileTree::open(folder / where);
    ImageFinder finder(*tree);
    for (const std::string path : {"a",
                                   "a.png",
                                   "a.jpg",
                                   "b",
                                   "b.tif",
                                   "images",
                                   "images/a",
                                   "images/a.tif",
                                   "images/v1.5",
                                   "images/v1.6",
                                   "images/left/b",
                                   "images/left/b.png",
                                   "images/left/in/c",
                                   "images/right/b",
                                   "images/a.png/b",
                                   "images_2/a",
                                   "images_4/a",
                                   "left/b",
                                   "linked/a",
                                   "linked/left/b",
                                   "notes/a",
                                   "",
                                   ".",
                                   "..",
                                   "../a",
                                   "../tree/a",
                                   "/a",
                                   "/a.png",
                                   "/images/a"}) {
      EXPECT_EQ(finder.find(path), find_image(*tree, path)) << where << " " << path;
      found += finder.find(path).empty() ? 0 : 1;
    }
  }
  EXPECT_EQ(found, 2 * 11 + 2) << "the links are in the folder alone";
}

TEST(ImageFinder, a_folder_is_listed_once_and_one_that_is_not_there_never) {
  std::map<std::string, int> looks;
  const auto files_in = [&](const std::string& folder) {
    ++looks[folder];
    return folder == "images/left" ? Names{"b.png"} : Names{};
  };
  const auto folders_in = [](const std::string& folder) {
    return folder.empty() ? Names{"images"} : folder == "images" ? Names{"left"} : Names{};
  };
  ImageFinder finder("capture", files_in, folders_in, 1000);
  for (int i = 0; i < 1000; ++i) {
    const std::string name = std::to_string(i);
    for (const std::string folder : {"", "a/b/", "images/", "images/right/left/", "left/"})
      EXPECT_EQ(finder.find(folder + name), "");
  }
  EXPECT_EQ(finder.find("images/left/b"), "images/left/b.png");
  EXPECT_EQ(finder.find("images/left/c"), "");
  EXPECT_THAT(looks, ElementsAre(Pair("", 1), Pair("images", 1), Pair("images/left", 1)));
}

// As links make them that lead back to where they are.
TEST(ImageFinderHostile, folders_without_end_are_refused) {
  const auto files_in = [](const std::string&) { return Names{}; };
  const auto folders_in = [](const std::string&) { return Names{"a"}; };
  ImageFinder finder("capture", files_in, folders_in, 20);
  std::string path = "b.png";
  for (int i = 0; i < 9; ++i) path = "a/" + path;
  EXPECT_EQ(finder.find(path), "");
  EXPECT_THAT(refusal_of([&] { finder.find("a/" + path); }),
              HasSubstr("capture: found more names than are kept"));
}

}  // namespace
}  // namespace traceflow
