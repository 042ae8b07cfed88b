#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <mutex>
#include <string>
#include <system_error>
#include <vector>

#include "base/atomic_file.h"
#include "support/file_bytes.h"
#include "support/refusal.h"
#include "support/temp_folder.h"

namespace {

// The folders that were synced, and what the system says to that.
std::mutex noting;  // other tests write from several threads
std::vector<std::filesystem::path> synced;
int answer = 0;

bool is_folder(int descriptor) {
  struct stat status {};
  return ::fstat(descriptor, &status) == 0 && S_ISDIR(status.st_mode);
}

}  // namespace

// In place of the system's own.
// NOLINTNEXTLINE(readability-inconsistent-declaration-parameter-name)
extern "C" int fsync(int descriptor) {
  if (!is_folder(descriptor)) return static_cast<int>(::syscall(SYS_fsync, descriptor));
  const std::lock_guard lock(noting);
  synced.push_back(std::filesystem::read_symlink("/proc/self/fd/" + std::to_string(descriptor)));
  errno = answer;
  return answer == 0 ? 0 : -1;
}

namespace traceflow {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class Sync : public testing::Test {
 protected:
  Sync() { synced.clear(); }
  ~Sync() override { answer = 0; }

  TempFolder folder_;
};

TEST_F(Sync, AFolderIsSyncedAfterARename) {
  write_atomically(folder_ / "file", "text");
  EXPECT_THAT(synced, ElementsAre(folder_.path()));
}

TEST_F(Sync, ARenameThatMayBeLostIsAnError) {
  for (const int error : {EIO, ENOSPC}) {
    answer = error;
    EXPECT_THAT(refusal_of([&] { write_atomically(folder_ / "file", "text"); }),
                AllOf(HasSubstr(folder_.path().string() + ": sync: found "),
                      HasSubstr(std::system_category().message(error))));
  }
}

TEST_F(Sync, AFileSystemThatSyncsNoFoldersIsTakenAsItIs) {
  for (const int error : {EINVAL, ENOTSUP}) {
    answer = error;
    EXPECT_EQ(refusal_of([&] { write_atomically(folder_ / "file", "text"); }), "accepted");
  }
}

TEST_F(Sync, EveryFolderInWhichOneIsMadeIsSynced) {
  const fs::path innermost = folder_ / "a" / "b" / "c";
  make_folder(innermost);
  EXPECT_TRUE(fs::is_directory(innermost));
  EXPECT_THAT(synced, ElementsAre(folder_.path(), folder_ / "a", folder_ / "a" / "b"));
  synced.clear();
  make_folder(innermost);
  make_folder("");
  EXPECT_THAT(synced, IsEmpty());
  make_folder(folder_ / "d" / "");
  EXPECT_THAT(synced, ElementsAre(folder_.path()));
}

TEST_F(Sync, AFolderThatCannotBeMadeIsSaidByName) {
  write_bytes(folder_ / "file", "");
  for (const fs::path& path : {folder_ / "file", folder_ / "file" / "inside"}) {
    EXPECT_THAT(refusal_of([&] { make_folder(path); }),
                HasSubstr((folder_ / "file").string() + ": found File exists"));
  }
}

}  // namespace
}  // namespace traceflow
