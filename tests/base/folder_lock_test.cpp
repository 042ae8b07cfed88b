#include "base/folder_lock.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <string>

#include "base/error.h"
#include "support/temp_folder.h"

namespace traceflow {
namespace {

using testing::AllOf;
using testing::HasSubstr;

TEST(FolderLock, KeepsOthersOutUntilItGoes) {
  const TempFolder folder;
  const std::filesystem::path file = folder / "lock";
  const auto lock = [&] { return FolderLock(file, folder / "run", "training"); };
  {
    const FolderLock first = lock();
    try {
      const FolderLock second = lock();
      FAIL() << "accepted";
    } catch (const InputError& error) {
      const std::string me = "process " + std::to_string(::getpid()) + " on ";
      EXPECT_THAT(error.what(), AllOf(HasSubstr((folder / "run").string() + ": found " + me),
                                      HasSubstr(" training in it, expected a folder of its own")));
    }
  }
  EXPECT_FALSE(std::filesystem::exists(file));
  EXPECT_NO_THROW(lock());
  // What a killed holder left holds nothing.
  std::ofstream(file) << "process 1 on elsewhere";
  EXPECT_NO_THROW(lock());
  EXPECT_THROW(FolderLock(folder / "nowhere" / "lock", folder / "nowhere", "training"), InputError);
}

}  // namespace
}  // namespace traceflow
