#include "scene/run_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/inotify.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <exception>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "base/error.h"
#include "files/input_file.h"
#include "support/refusal.h"
#include "support/temp_folder.h"

namespace traceflow {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

Safetensors state(int iteration) {
  Safetensors file;
  file.metadata["iteration"] = std::to_string(iteration);
  Tensor<float> numbers(Shape{100});
  numbers.fill(static_cast<float>(iteration));
  file.add("numbers", numbers);
  return file;
}

void flip_last_byte(const fs::path& path) {
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  file.seekg(-1, std::ios::end);
  const char byte = static_cast<char>(file.get() ^ 1);
  file.seekp(-1, std::ios::end);
  file.put(byte);
}

std::string refusal(const RunFolder& run) {
  return refusal_of([&] {
    std::string note;
    read_checkpoint(run, note);
  });
}

class RunFolderTest : public testing::Test {
 protected:
  // The newest that can be read.
  double newest() { return read_checkpoint(run_, note_).number("iteration"); }

  TempFolder folder_;
  RunFolder run_{folder_ / "run"};
  std::string note_;
};

TEST_F(RunFolderTest, KeepsTheLastTwo) {
  EXPECT_FALSE(run_.holds_a_run());
  for (const int iteration : {1, 2, 3}) {
    write_checkpoint(run_, state(iteration));
    EXPECT_EQ(newest(), iteration);
    EXPECT_EQ(note_, "");
  }
  EXPECT_EQ(Safetensors::read(run_.previous_checkpoint()).number("iteration"), 2);
  EXPECT_EQ(Safetensors::read(run_.checkpoint()).number("version"), checkpoint_version);
  EXPECT_EQ(std::distance(fs::directory_iterator(run_.folder), fs::directory_iterator()), 2);
}

TEST_F(RunFolderTest, ADamagedOneIsNamedByItsSectionAndTheOneBeforeServes) {
  write_checkpoint(run_, state(1));
  write_checkpoint(run_, state(2));
  flip_last_byte(run_.checkpoint());
  EXPECT_EQ(newest(), 1);
  EXPECT_THAT(note_, AllOf(HasSubstr("checkpoint.safetensors: tensor numbers: found bytes with the checksum"),
                           HasSubstr("using the checkpoint before it, of iteration 1")));
  flip_last_byte(run_.previous_checkpoint());
  EXPECT_THAT(refusal(run_), AllOf(HasSubstr("checkpoint.safetensors: tensor numbers"),
                                   HasSubstr("nor can the one before it be used: "),
                                   HasSubstr("checkpoint.previous.safetensors: tensor numbers")));
  fs::remove(run_.previous_checkpoint());
  EXPECT_THAT(refusal(run_), HasSubstr("no checkpoint before it to go back to"));
}

TEST_F(RunFolderTest, OneThatIsDroppedLeavesTheOneBefore) {
  write_checkpoint(run_, state(1));
  write_checkpoint(run_, state(2));
  write_checkpoint(run_, state(3), Current::is_dropped);
  EXPECT_EQ(newest(), 3);
  EXPECT_EQ(Safetensors::read(run_.previous_checkpoint()).number("iteration"), 1);
}

// As many open files as there may be: what cannot be read now need not be damaged.
TEST_F(RunFolderTest, OneThatCannotBeReadIsNotTakenForDamaged) {
  write_checkpoint(run_, state(1));
  write_checkpoint(run_, state(2));
  // The sanitizers open files to look at an object for the first time, here at the one that has the reason.
  EXPECT_THROW(InputFile(run_.checkpoint().string() + ".missing"), InputError);
  rlimit usual{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &usual), 0);
  const rlimit none{0, usual.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  // Looked at later: the sanitizers open files to look at an object.
  std::exception_ptr refused;
  try {
    newest();
  } catch (const InputError&) {
    refused = std::current_exception();
  }
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &usual), 0);
  ASSERT_TRUE(refused);
  EXPECT_THAT(
      refusal_of([&] { std::rethrow_exception(refused); }),
      AllOf(HasSubstr("checkpoint.safetensors: found Too many open files"), Not(HasSubstr("before it"))));
  EXPECT_EQ(newest(), 2);
  EXPECT_EQ(note_, "");
}

TEST_F(RunFolderTest, APathThatLeadsNowhereIsRefused) {
  fs::create_directory_symlink(run_.folder, run_.folder);
  EXPECT_THAT(refusal(run_), HasSubstr("checkpoint.safetensors: found Too many levels of symbolic links"));
  EXPECT_THROW(write_checkpoint(run_, state(1)), InputError);
}

// A damaged one must not push a sound one out.
TEST_F(RunFolderTest, WhatWasSetAsideDoesNotTakeThePlaceOfTheOneBefore) {
  write_checkpoint(run_, state(1));
  write_checkpoint(run_, state(2));
  flip_last_byte(run_.checkpoint());
  set_damaged_aside(run_);
  EXPECT_EQ(newest(), 1);
  write_checkpoint(run_, state(3));
  EXPECT_EQ(newest(), 3);
  EXPECT_EQ(Safetensors::read(run_.previous_checkpoint()).number("iteration"), 1);
  EXPECT_TRUE(fs::exists(run_.damaged_checkpoint()));
}

// Every place at which a program that writes a checkpoint may be killed leaves one that can be read.
TEST_F(RunFolderTest, BetweenAnyTwoStepsOfWritingOneStands) {
  write_checkpoint(run_, state(1));
  write_checkpoint(run_, state(2));
  const fs::path fresh = run_.folder / "checkpoint.new.safetensors";
  std::ofstream(fresh.string() + ".partial") << "half";
  EXPECT_EQ(newest(), 2);
  Safetensors next = state(3);
  next.metadata["version"] = "2";
  next.write(fresh);
  EXPECT_EQ(newest(), 2);
  const fs::path link = run_.previous_checkpoint().string() + ".link";
  fs::create_hard_link(run_.checkpoint(), link);
  EXPECT_EQ(newest(), 2);
  fs::rename(link, run_.previous_checkpoint());
  EXPECT_EQ(newest(), 2);
  EXPECT_EQ(note_, "");
  fs::rename(fresh, run_.checkpoint());
  EXPECT_EQ(newest(), 3);
  // And the next one is written over what was left.
  std::ofstream(fresh.string() + ".partial") << "half";
  fs::create_hard_link(run_.checkpoint(), link);
  write_checkpoint(run_, state(4));
  EXPECT_EQ(newest(), 4);
  EXPECT_EQ(std::distance(fs::directory_iterator(run_.folder), fs::directory_iterator()), 2);
}

// Names that files of a folder lose, one after another, while `work` goes on.
std::vector<std::string> names_lost(const fs::path& folder, const std::function<void()>& work) {
  const int ear = ::inotify_init1(IN_NONBLOCK | IN_CLOEXEC);
  EXPECT_GE(::inotify_add_watch(ear, folder.c_str(), IN_MOVED_FROM | IN_DELETE), 0);
  work();
  alignas(inotify_event) std::array<char, 4096> told{};
  const ssize_t size = ::read(ear, told.data(), told.size());
  ::close(ear);
  std::vector<std::string> names;
  for (ssize_t at = 0; at < size;) {
    const auto* event = reinterpret_cast<const inotify_event*>(told.data() + at);
    names.emplace_back(event->name);
    at += static_cast<ssize_t>(sizeof(inotify_event) + event->len);
  }
  return names;
}

TEST_F(RunFolderTest, TheCurrentOneNeverLosesItsName) {
  write_checkpoint(run_, state(1));
  const auto lost = names_lost(run_.folder, [&] { write_checkpoint(run_, state(2)); });
  EXPECT_THAT(lost, Contains("checkpoint.new.safetensors"));
  EXPECT_THAT(lost, Not(Contains("checkpoint.safetensors")));
  EXPECT_EQ(Safetensors::read(run_.previous_checkpoint()).number("iteration"), 1);
}

// A save that was killed when the current one had both names.
TEST_F(RunFolderTest, ACheckpointWithBothNamesIsFollowedAsAnyOther) {
  write_checkpoint(run_, state(1));
  fs::create_hard_link(run_.checkpoint(), run_.previous_checkpoint());
  write_checkpoint(run_, state(2));
  EXPECT_EQ(newest(), 2);
  EXPECT_EQ(Safetensors::read(run_.previous_checkpoint()).number("iteration"), 1);
  EXPECT_EQ(std::distance(fs::directory_iterator(run_.folder), fs::directory_iterator()), 2);
}

TEST_F(RunFolderTest, WhereNoFileMayHaveTwoNamesTheLastTwoAreKeptToo) {
  write_checkpoint(run_, state(1));
  fs::create_directories(run_.previous_checkpoint().string() + ".link/in_the_way");
  for (const int iteration : {2, 3}) {
    write_checkpoint(run_, state(iteration));
    EXPECT_EQ(newest(), iteration);
    EXPECT_EQ(Safetensors::read(run_.previous_checkpoint()).number("iteration"), iteration - 1);
  }
}

TEST_F(RunFolderTest, ARefusedWriteLeavesBoth) {
  write_checkpoint(run_, state(1));
  write_checkpoint(run_, state(2));
  fs::create_directory(run_.folder / "checkpoint.new.safetensors.partial");
  EXPECT_THROW(write_checkpoint(run_, state(3)), InputError);
  EXPECT_EQ(newest(), 2);
  EXPECT_EQ(Safetensors::read(run_.previous_checkpoint()).number("iteration"), 1);
}

// As version 1 wrote them, which had no checksums: the bytes of a header by hand.
std::string without_checksums(const std::string& version) {
  const std::string header = R"({"__metadata__":{"iteration":"7","version":")" + version +
                             R"("},"numbers":{"data_offsets":[0,4],"dtype":"F32","shape":[1]}})";
  std::string bytes(8, '\0');
  bytes[0] = static_cast<char>(header.size());
  return bytes + header + std::string(4, '\0');
}

TEST_F(RunFolderTest, VersionsOlderAndNewer) {
  fs::create_directory(run_.folder);
  std::ofstream(run_.checkpoint(), std::ios::binary) << without_checksums("1");
  EXPECT_EQ(newest(), 7);
  std::ofstream(run_.checkpoint(), std::ios::binary) << without_checksums("2");
  EXPECT_THAT(refusal(run_), HasSubstr("metadata: found no checksums"));

  Safetensors newer = state(9);
  newer.metadata["version"] = std::to_string(checkpoint_version + 1);
  write_checkpoint(run_, state(8));
  fs::rename(run_.checkpoint(), run_.previous_checkpoint());
  newer.write(run_.checkpoint());
  // Not damaged: going back behind it would lose work.
  EXPECT_THAT(refusal(run_), AllOf(HasSubstr("found 3, expected at most 2"), HasSubstr("newer traceflow")));
}

}  // namespace
}  // namespace traceflow
