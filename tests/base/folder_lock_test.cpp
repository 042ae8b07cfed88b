#include "base/folder_lock.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <string>
#include <thread>

#include "base/error.h"
#include "base/process.h"
#include "support/file_bytes.h"
#include "support/refusal.h"
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

TEST(FolderLock, WritesToNothingThatALinkLeadsTo) {
  const TempFolder folder;
  write_bytes(folder / "letter", "dear all");
  std::filesystem::create_symlink(folder / "letter", folder / "lock");
  EXPECT_THAT(
      refusal_of([&] { FolderLock(folder / "lock", folder / "run", "training"); }),
      HasSubstr((folder / "lock").string() + ": found a link, expected the lock of a folder; remove it"));
  EXPECT_EQ(bytes_of(folder / "letter"), "dear all");
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "lock"));
}

// As `prepare` killed while COLMAP works: what COLMAP writes must not meet what a second `prepare` does.
TEST(FolderLock, OutlivesAKilledHolderForAsLongAsWhatItStartedGoesOn) {
  const TempFolder folder;
  const auto lock = [&] { return FolderLock(folder / "lock", folder / "work", "preparing"); };
  const pid_t holder = ::fork();
  ASSERT_GE(holder, 0);
  if (holder == 0) {
    const FolderLock held = lock();
    // A script that starts the program which does the work.
    const Descriptor out = open_log(folder / "out");
    Process({"sh", "-c", "sleep 1000 & echo $!; wait"}, {.output = out.number()}).wait();
    ::_exit(1);
  }
  while (bytes_of(folder / "out").find('\n') == std::string::npos) std::this_thread::yield();
  const pid_t worker = std::stoi(bytes_of(folder / "out"));
  const pid_t script = ::getpgid(worker);  // which leads a group of its own
  EXPECT_THAT(refusal_of(lock), HasSubstr("found process " + std::to_string(holder) + " on "));

  ::kill(holder, SIGKILL);
  ::waitpid(holder, nullptr, 0);
  const auto refused = HasSubstr("found a program that outlived process " + std::to_string(holder) + " on ");
  EXPECT_THAT(refusal_of(lock), refused);
  ::kill(script, SIGKILL);
  EXPECT_THAT(refusal_of(lock), refused);
  ::kill(worker, SIGKILL);
  while (refusal_of(lock) != "accepted") std::this_thread::yield();
}

}  // namespace
}  // namespace traceflow
