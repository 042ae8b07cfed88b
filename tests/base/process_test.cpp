#include "base/process.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <chrono>
#include <csignal>
#include <thread>

#include "base/error.h"
#include "support/file_bytes.h"
#include "support/temp_folder.h"

namespace traceflow {
namespace {

// Init may take a moment to bury what has ended.
bool is_alive(pid_t id) {
  return ::kill(id, 0) == 0 &&
         bytes_of("/proc/" + std::to_string(id) + "/stat").find(" Z ") == std::string::npos;
}

TEST(Process, TellsWhetherTheProgramEndedWell) {
  EXPECT_TRUE(Process({"sh", "-c", "exit 0"}, {}).wait());
  EXPECT_FALSE(Process({"sh", "-c", "exit 3"}, {}).wait());
  EXPECT_FALSE(Process({"sh", "-c", "kill -9 $$"}, {}).wait());
}

// As a parent may leave it to the programs that it starts.
TEST(Process, TellsItWhereSignalsOfChildrenWereIgnored) {
  const std::atomic<bool> never = false;
  const auto before = std::signal(SIGCHLD, SIG_IGN);
  EXPECT_TRUE(Process({"sh", "-c", "exit 0"}, {}).wait());
  std::signal(SIGCHLD, SIG_IGN);
  EXPECT_TRUE(Process({"sh", "-c", "exit 0"}, {}).wait(never));
  EXPECT_FALSE(Process({"sh", "-c", "exit 3"}, {}).wait(never));
  std::signal(SIGCHLD, before);
}

// By its number, which may be another's by now: here it is still that of the group that it leaves behind.
TEST(Process, WhatSomebodyElseHasWaitedForIsNotSignalled) {
  const TempFolder folder;
  const Descriptor out = open_log(folder / "out");
  {
    Process process({"sh", "-c", "sleep 1000 & echo $!"}, {.output = out.number()});
    ASSERT_GT(::waitpid(-1, nullptr, 0), 0);
    EXPECT_FALSE(process.wait());
  }
  const pid_t left = std::stoi(bytes_of(folder / "out"));
  // A signal would need a moment.
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_TRUE(is_alive(left));
  ::kill(left, SIGKILL);
}

TEST(Process, ConnectsTheStreamsAndAddsToTheEnvironment) {
  const TempFolder folder;
  Pipe input = make_pipe();
  const Descriptor out = open_log(folder / "out"), error = open_log(folder / "error");
  Process process({"sh", "-c", "read line; echo \"$line $WORD\"; echo bad >&2"},
                  {input.reading.number(), out.number(), error.number(), {"WORD=there"}});
  ASSERT_EQ(::write(input.writing.number(), "hello\n", 6), 6);
  EXPECT_TRUE(process.wait());
  EXPECT_EQ(bytes_of(folder / "out"), "hello there\n");
  EXPECT_EQ(bytes_of(folder / "error"), "bad\n");
}

TEST(Process, ArgumentsAreNoShellWords) {
  const TempFolder folder;
  const Descriptor out = open_log(folder / "out");
  EXPECT_TRUE(Process({"echo", "$HOME; ls *", "a  b"}, {.output = out.number()}).wait());
  EXPECT_EQ(bytes_of(folder / "out"), "$HOME; ls * a  b\n");
}

TEST(Process, AProgramThatIsNotThereIsNamed) {
  EXPECT_TRUE(is_in_path("sh"));
  EXPECT_FALSE(is_in_path("no-such-program-here"));
  try {
    Process({"no-such-program-here"}, {});
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("no-such-program-here"));
  }
}

TEST(Process, AStopEndsTheProgramAndWhatItHasStarted) {
  const TempFolder folder;
  const Descriptor out = open_log(folder / "out");
  Process process({"sh", "-c", "sleep 1000 & echo $!; wait"}, {.output = out.number()});
  while (bytes_of(folder / "out").find('\n') == std::string::npos) std::this_thread::yield();
  const std::atomic<bool> stop = true;
  EXPECT_FALSE(process.wait(stop));
  const pid_t child = std::stoi(bytes_of(folder / "out"));
  while (is_alive(child)) std::this_thread::yield();
}

TEST(Process, WhatIsLeftIsEnded) {
  pid_t id = 0;
  {
    const TempFolder folder;
    const Descriptor out = open_log(folder / "out");
    Process process({"sh", "-c", "echo $$; exec sleep 1000"}, {.output = out.number()});
    while (bytes_of(folder / "out").find('\n') == std::string::npos) std::this_thread::yield();
    id = std::stoi(bytes_of(folder / "out"));
  }
  EXPECT_NE(::kill(id, 0), 0);
}

}  // namespace
}  // namespace traceflow
