#include "files/file_tree.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
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

class LinkedTree : public testing::Test {
 protected:
  void link(const std::filesystem::path& to, const std::string& name) const {
    std::filesystem::create_symlink(to, folder_ / name);
  }
  TempFolder folder_;
};

TEST_F(LinkedTree, LinksAreFollowedWhereverTheyLead) {
  write(folder_ / "tree/real.txt", "text");
  write(folder_ / "tree/sub/deep.txt", "deep");
  write(folder_ / "disk/images/a.png", "image");
  write(folder_ / "disk/images/room/b.png", "farther");
  link("real.txt", "tree/inside.txt");
  link("sub", "tree/near");
  link(folder_ / "disk/images/a.png", "tree/outside.txt");
  link(folder_ / "disk/images", "tree/rgb");
  link("../rgb/room", "tree/sub/further");
  link(folder_ / "disk/../tree", "alias");
  const auto tree = FileTree::open(folder_ / "alias");

  EXPECT_THAT(tree->folders_in(""), ElementsAre("near", "rgb", "sub"));
  EXPECT_THAT(tree->files_in(""), ElementsAre("inside.txt", "outside.txt", "real.txt"));
  EXPECT_THAT(tree->folders_in("sub"), ElementsAre("further"));
  EXPECT_THAT(tree->files_in("rgb"), ElementsAre("a.png"));
  EXPECT_THAT(tree->folders_in("rgb"), ElementsAre("room"));
  for (const char* path : {"near", "rgb", "rgb/room", "sub/further", "near/further"})
    EXPECT_TRUE(tree->has_folder(path)) << path;
  const std::vector<std::pair<std::string, std::string>> expected = {
      {"inside.txt", "text"},          {"near/deep.txt", "deep"},     {"outside.txt", "image"},
      {"rgb/a.png", "image"},          {"rgb/room/b.png", "farther"}, {"near/further/b.png", "farther"},
      {"sub/further/b.png", "farther"}};
  for (const auto& [path, text] : expected) {
    EXPECT_TRUE(tree->has(path)) << path;
    EXPECT_EQ(read(*tree, path), text) << path;
  }
  // What the letters of a path say is another matter: a capture's files name paths, its owner makes links.
  EXPECT_FALSE(tree->has("rgb/../../disk/images/a.png"));
  EXPECT_THAT(error_of([&] { read(*tree, "../disk/images/a.png"); }), HasSubstr("a path inside the capture"));
}

TEST_F(LinkedTree, ALinkThatLeadsNowhereIsNamedToWhoeverNeedsIt) {
  write(folder_ / "tree/real.txt", "text");
  link("missing", "tree/nowhere");
  link(folder_ / "unplugged/images", "tree/rgb");
  link("itself", "tree/itself");
  link("pong", "tree/ping");
  link("ping", "tree/pong");
  const auto tree = FileTree::open(folder_ / "tree");
  const std::string tree_path = (folder_ / "tree").string();
  const std::vector<std::array<std::string, 3>> expected = {
      {"nowhere", "the link nowhere to missing", "which is not there"},
      {"rgb/1x/a.png", "the link rgb to " + (folder_ / "unplugged/images").string(), "which is not there"},
      {"itself", "the link itself to itself", "which leads back to itself"},
      {"itself/deep/a", "the link itself to itself", "which leads back to itself"},
      {"ping", "the link ping to pong", "which leads back to itself"}};
  for (const auto& [path, link, why] : expected) {
    EXPECT_TRUE(tree->has(path)) << path;
    EXPECT_TRUE(tree->has_folder(path)) << path;
    EXPECT_EQ(error_of([&, path = path] { read(*tree, path); }),
              tree_path + "/" + path + ": found " + link + ", " + why +
                  ", expected a readable file; make the link again, or put the files themselves there");
    EXPECT_THAT(tree->files_in(path), IsEmpty());
  }
  for (const bool folders : {false, true}) {
    const std::vector<std::string> names = folders ? tree->folders_in("") : tree->files_in("");
    for (const char* name : {"nowhere", "rgb", "itself", "ping"})
      EXPECT_THAT(names, testing::Contains(name)) << folders;
  }
  EXPECT_FALSE(tree->has("other"));
  EXPECT_FALSE(tree->has("real.txt/other"));
  EXPECT_FALSE(tree->has_folder("real.txt"));
  EXPECT_THAT(error_of([&] { FileTree::open(folder_ / "tree/rgb"); }), HasSubstr("unplugged"));
}

// Each step of such a path is a folder that is there.
TEST_F(LinkedTree, AFolderThatHoldsItselfIsNotWalkedByItself) {
  write(folder_ / "tree/real.txt", "text");
  link(".", "tree/again");
  link(folder_.path(), "tree/above");
  const auto tree = FileTree::open(folder_ / "tree");
  EXPECT_THAT(tree->folders_in(""), ElementsAre("above", "again"));
  EXPECT_THAT(tree->files_in("again/again/again"), ElementsAre("real.txt"));
  EXPECT_EQ(read(*tree, "above/tree/again/real.txt"), "text");
}

// As `zip --symlinks` packs one: what it leads to stands in it as text, and is not followed.
TEST_F(LinkedTree, AnArchiveHoldsNoLinks) {
  write(folder_ / "secret", "secret");
  const std::string target = (folder_ / "secret").string();
  write(folder_ / "a.zip", zip_archive({{"link", target}, {"real", "text"}}, false));
  const auto tree = FileTree::open(folder_ / "a.zip");
  EXPECT_EQ(read(*tree, "link"), target);
  EXPECT_FALSE(tree->has("link/real"));
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
