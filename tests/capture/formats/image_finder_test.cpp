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

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Pair;

using Names = std::vector<std::string>;

bool nothing(const std::string& file) {
  ADD_FAILURE() << "asked for " << file;
  return false;
}

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
  ImageFinder finder("capture", files_in, folders_in, nothing, 1000);
  for (int i = 0; i < 1000; ++i) {
    const std::string name = std::to_string(i);
    for (const std::string folder : {"", "a/b/", "images/", "images/right/left/", "left/"})
      EXPECT_EQ(finder.find(folder + name), "");
  }
  EXPECT_EQ(finder.find("images/left/b"), "images/left/b.png");
  EXPECT_EQ(finder.find("images/left/c"), "");
  EXPECT_THAT(looks, ElementsAre(Pair("", 1), Pair("images", 1), Pair("images/left", 1)));
}

// Lists keep the case in which a file was made, whether or not the system minds it.
TEST(ImageFinder, whether_case_matters_is_asked_of_the_system) {
  const auto files_in = [](const std::string& folder) {
    return folder == "images" ? Names{"A.png", "IMG_1.JPG", "a.png"} : Names{};
  };
  const auto folders_in = [](const std::string& folder) {
    return folder.empty() ? Names{"images"} : Names{};
  };
  for (const bool ignores_case : {false, true}) {
    Names asked;
    const auto has = [&](const std::string& file) {
      asked.push_back(file);
      return ignores_case;
    };
    ImageFinder finder("capture", files_in, folders_in, has, 1000);
    for (const std::string path : {"images/IMG_1", "images/IMG_1.jpg", "images/a", "images/A.jpg"})
      EXPECT_NE(finder.find(path), "") << path;
    EXPECT_EQ(finder.find("images/a"), "images/a.png");
    EXPECT_EQ(finder.find("images/A"), "images/A.png");
    for (const std::string path :
         {"images/img_2.jpg", "Images/img_2.jpg", "Images/left/img_1.jpg", "img_1.jpg"})
      EXPECT_EQ(finder.find(path), "") << path;
    EXPECT_THAT(asked, IsEmpty()) << "what the lists tell";
    for (const std::string path : {"Images/img_1.jpg", "images/Img_1", "IMAGES/IMG_1.JPG"})
      EXPECT_EQ(finder.find(path), ignores_case ? "images/IMG_1.JPG" : "") << path;
    EXPECT_THAT(asked, Contains("Images/img_1.jpg"));
    EXPECT_THAT(asked, Contains("IMAGES/IMG_1.JPG"));
  }
}

TEST(ImageFinder, a_folder_that_seems_empty_may_not_let_itself_be_listed) {
  const auto files_in = [](const std::string&) { return Names{}; };
  const auto folders_in = [](const std::string& folder) {
    return folder.empty() ? Names{"images"} : Names{};
  };
  const auto has = [](const std::string& file) {
    EXPECT_TRUE(file.starts_with("images/")) << file;
    return file == "images/1.jpg" || file == "images/left/2.png";
  };
  ImageFinder finder("capture", files_in, folders_in, has, 1000);
  EXPECT_EQ(finder.find("images/1.jpg"), "images/1.jpg");
  EXPECT_EQ(finder.find("images/left/2"), "images/left/2.png");
  EXPECT_EQ(finder.find("images/2"), "");
  EXPECT_EQ(finder.find("left/2"), "");
}

// As links make them that lead back to where they are.
TEST(ImageFinderHostile, folders_without_end_are_refused) {
  const auto files_in = [](const std::string&) { return Names{}; };
  const auto folders_in = [](const std::string&) { return Names{"a"}; };
  ImageFinder finder("capture", files_in, folders_in, nothing, 20);
  std::string path = "b.png";
  for (int i = 0; i < 9; ++i) path = "a/" + path;
  EXPECT_EQ(finder.find(path), "");
  EXPECT_THAT(refusal_of([&] { finder.find("a/" + path); }),
              HasSubstr("capture: found more names than are kept"));
}

}  // namespace
}  // namespace traceflow
