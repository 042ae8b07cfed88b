#include "scene/run_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "base/error.h"
#include "support/refusal.h"
#include "support/temp_folder.h"

namespace traceflow {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

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
  fs::rename(run_.checkpoint(), run_.previous_checkpoint());
  EXPECT_EQ(newest(), 2);
  fs::rename(fresh, run_.checkpoint());
  EXPECT_EQ(newest(), 3);
  // And the next one is written over what was left.
  std::ofstream(fresh.string() + ".partial") << "half";
  write_checkpoint(run_, state(4));
  EXPECT_EQ(newest(), 4);
  EXPECT_EQ(std::distance(fs::directory_iterator(run_.folder), fs::directory_iterator()), 2);
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
