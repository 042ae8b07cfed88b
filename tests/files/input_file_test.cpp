#include "files/input_file.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <set>

#include "base/error.h"
#include "support/refusal.h"
#include "support/temp_folder.h"

namespace traceflow {
namespace {

// Nobody will ever write to it: whoever waited for that would wait for ever.
TEST(InputFileHostile, APipeIsRefusedAtOnce) {
  const TempFolder folder;
  const auto path = folder / "points.npy";
  ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
  try {
    const InputFile file(path);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()),
              path.string() + ": found something that is not a regular file, expected a readable file");
  }
}

// Descriptors that a program gets which this one starts.
std::set<int> descriptors_handed_on() {
  std::set<int> result;
  for (int descriptor = 0; descriptor < 1024; ++descriptor) {
    const int flags = ::fcntl(descriptor, F_GETFD);
    if (flags >= 0 && (flags & FD_CLOEXEC) == 0) result.insert(descriptor);
  }
  return result;
}

// The room that it takes is given back when it is closed: a program that had it too would keep it.
TEST(InputFile, AScratchFileIsNotHandedOnToOtherPrograms) {
  const std::set<int> before = descriptors_handed_on();
  InputFile scratch = InputFile::scratch("a.npz");
  EXPECT_EQ(descriptors_handed_on(), before);
  scratch.append(std::as_bytes(std::span("text")));
  EXPECT_EQ(scratch.size(), 5);
}

// As one that comes between the look at a path and the opening would have to be.
TEST(InputFileHostile, BelowAFolderNoLinkIsFollowed) {
  namespace fs = std::filesystem;
  const TempFolder folder;
  fs::create_directories(folder / "tree/sub");
  fs::create_directory(folder / "room");
  for (const char* name : {"tree/sub/a", "room/a"}) std::ofstream(folder / name) << "text";
  fs::create_symlink(folder / "room/a", folder / "tree/sub/link");
  fs::create_directory_symlink(folder / "room", folder / "tree/other");
  fs::create_directory_symlink("tree", folder / "alias");
  const InputFile file = InputFile::below(folder / "alias", "sub/a", "name");
  EXPECT_EQ(file.size(), 4);
  EXPECT_EQ(file.path(), "name");
  for (const char* path : {"sub/link", "other/a"})
    EXPECT_THROW(InputFile::below(folder / "alias", path, "name"), UnreadableFile) << path;
  EXPECT_EQ(refusal_of([&] { InputFile::below(folder / "alias", "none/a", "name"); }),
            "name: found No such file or directory, expected a readable file");
}

}  // namespace
}  // namespace traceflow
