#include "files/file_tree.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "base/error.h"
#include "support/temp_folder.h"
#include "support/zip_writer.h"

namespace traceflow {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

void write(const std::filesystem::path& path, const std::string& text) {
  std::filesystem::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << text;
}

std::string read(const FileTree& tree, const std::string& path) {
  const InputFile file = tree.open_file(path);
  std::string text(static_cast<size_t>(file.size()), '\0');
  file.read_at(0, std::as_writable_bytes(std::span(text)));
  return text;
}

std::string error_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

const std::vector<std::pair<std::string, std::string>> files = {
    {"b.txt", "second"}, {"a.txt", "first"}, {"sub/c.txt", std::string(1000, 'c')}, {"sub/deep/d", "fourth"}};

// The same files as a folder, in a zip archive either way of storing, and in one whose files share a folder.
class SameFiles : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    const std::string& kind = GetParam();
    if (kind == "folder") {
      for (const auto& [name, text] : files) write(folder_ / "tree" / name, text);
      return;
    }
    auto members = files;
    if (kind == "wrapped") {
      for (auto& [name, text] : members) name = "capture/" + name;
      members.emplace_back("__MACOSX/capture/._a.txt", "clutter");
    }
    write(folder_ / "tree", zip_archive(members, kind != "stored"));
  }
  TempFolder folder_;
};

TEST_P(SameFiles, AreFoundListedAndRead) {
  const auto tree = FileTree::open(folder_ / "tree");
  EXPECT_THAT(tree->files_in(""), ElementsAre("a.txt", "b.txt"));
  EXPECT_THAT(tree->folders_in(""), ElementsAre("sub"));
  EXPECT_THAT(tree->files_in("sub"), ElementsAre("c.txt"));
  EXPECT_THAT(tree->folders_in("sub"), ElementsAre("deep"));
  EXPECT_THAT(tree->files_in("none"), IsEmpty());
  EXPECT_TRUE(tree->has_folder("sub/deep"));
  EXPECT_FALSE(tree->has_folder("su"));
  EXPECT_FALSE(tree->has_folder("a.txt"));
  EXPECT_FALSE(tree->has("sub"));
  for (const auto& [name, text] : files) {
    EXPECT_TRUE(tree->has(name)) << name;
    EXPECT_EQ(read(*tree, name), text) << name;
  }
  EXPECT_EQ(read(*tree, "./sub/../a.txt"), "first");
  EXPECT_EQ(tree->open_file("a.txt").path(), folder_ / "tree/a.txt");
}

TEST_P(SameFiles, PathsDoNotLeadOut) {
  write(folder_ / "secret", "secret");
  const auto tree = FileTree::open(folder_ / "tree");
  const std::vector<std::string> paths{"../secret", "sub/../../secret", folder_ / "secret", "/etc/passwd",
                                       "sub\\..\\secret"};
  for (const std::string& path : paths) {
    EXPECT_FALSE(tree->has(path)) << path;
    EXPECT_THAT(error_of([&] { read(*tree, path); }), HasSubstr("expected")) << path;
  }
  EXPECT_THAT(tree->files_in(".."), IsEmpty());
  EXPECT_FALSE(tree->has_folder(".."));
  EXPECT_THAT(error_of([&] { read(*tree, "missing"); }), HasSubstr("missing"));
}

INSTANTIATE_TEST_SUITE_P(FileTree, SameFiles, testing::Values("folder", "stored", "deflated", "wrapped"),
                         [](const auto& test) { return test.param; });

TEST(FileTree, LinksAreFollowedInsideAlone) {
  const TempFolder folder;
  const auto link = [&](const std::filesystem::path& to, const std::string& name) {
    std::filesystem::create_symlink(to, folder / name);
  };
  write(folder / "tree/real.txt", "text");
  write(folder / "tree/sub/deep.txt", "deep");
  write(folder / "treehouse/secret.txt", "secret");
  write(folder / "treehouse/room/hidden.txt", "hidden");
  link("real.txt", "tree/inside.txt");
  link("../real.txt", "tree/sub/up.txt");
  link("sub", "tree/near");
  link("../tree/sub", "tree/round");
  link(folder / "treehouse/secret.txt", "tree/outside.txt");
  link(folder / "treehouse", "tree/other");
  link("../other/room", "tree/sub/further");
  link(folder.path(), "tree/sub/above");
  link("missing", "tree/nowhere");
  link("itself", "tree/itself");
  link("tree", "alias");
  const auto tree = FileTree::open(folder / "alias");

  EXPECT_THAT(tree->folders_in(""), ElementsAre("near", "round", "sub"));
  EXPECT_THAT(tree->folders_in("sub"), IsEmpty());
  for (const char* path : {"near", "round", "sub"}) {
    EXPECT_TRUE(tree->has_folder(path)) << path;
    EXPECT_THAT(tree->files_in(path), ElementsAre("deep.txt", "up.txt")) << path;
  }
  for (const char* path :
       {"other", "other/room", "sub/further", "near/further", "near/above", "nowhere", "itself"}) {
    EXPECT_FALSE(tree->has_folder(path)) << path;
    EXPECT_THAT(tree->files_in(path), IsEmpty()) << path;
    EXPECT_THAT(tree->folders_in(path), IsEmpty()) << path;
  }

  // A file that is a link out is no less there: what asks for it is to be told.
  EXPECT_THAT(tree->files_in(""), ElementsAre("inside.txt", "outside.txt", "real.txt"));
  for (const char* path : {"outside.txt", "other/secret.txt", "sub/further/hidden.txt"}) {
    EXPECT_TRUE(tree->has(path)) << path;
    const std::string error = error_of([&] { read(*tree, path); });
    EXPECT_THAT(error, HasSubstr("alias/" + std::string(path) + ": found a link out of the folder, to "));
    EXPECT_THAT(error, HasSubstr("treehouse"));
  }
  for (const char* path : {"inside.txt", "sub/up.txt", "near/up.txt", "near/above/tree/real.txt"}) {
    EXPECT_TRUE(tree->has(path)) << path;
    EXPECT_EQ(read(*tree, path), "text") << path;
  }
  for (const char* path : {"nowhere", "itself", "nowhere/deep.txt"}) {
    EXPECT_FALSE(tree->has(path)) << path;
    EXPECT_THAT(error_of([&] { read(*tree, path); }), HasSubstr(path));
  }
}

TEST(FileTree, ArchivesWithImpossibleNamesAreRefused) {
  const TempFolder folder;
  for (const std::string name : {"../a", "/a", "a/../../b", "a\\b"}) {
    write(folder / "a.zip", zip_archive({{name, "x"}, {"good", "y"}}, false));
    EXPECT_THAT(error_of([&] { FileTree::open(folder / "a.zip"); }), HasSubstr(name));
  }
  write(folder / "a.zip", zip_archive({{"a", "x"}, {"./a", "y"}}, false));
  EXPECT_THAT(error_of([&] { FileTree::open(folder / "a.zip"); }), HasSubstr("two members a"));
  write(folder / "a.zip", "no archive");
  EXPECT_THAT(error_of([&] { FileTree::open(folder / "a.zip"); }), HasSubstr("a.zip"));
  EXPECT_THAT(error_of([&] { FileTree::open(folder / "missing"); }), HasSubstr("a folder or a zip archive"));
}

}  // namespace
}  // namespace traceflow
