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

TEST(InputFile, ErrorsCallItByTheNameThatItWasGiven) {
  const TempFolder folder;
  std::ofstream(folder / "a") << "text";
  const InputFile file(folder / "a", "name");
  EXPECT_EQ(file.size(), 4);
  EXPECT_EQ(file.path(), "name");
  EXPECT_EQ(refusal_of([&] { InputFile(folder / "none", "name"); }),
            "name: found No such file or directory, expected a readable file");
}

}  // namespace
}  // namespace traceflow
