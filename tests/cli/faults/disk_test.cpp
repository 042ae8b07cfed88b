#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cli/faults/small_training.h"
#include "support/refusal.h"

// Any call to the disk refused: a write for want of room, a sync or a renaming for a fault of the disk.
namespace traceflow::faults {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr int64_t all_that_follow = int64_t{1} << 40;

class CheckpointOnDisk : public testing::Test {
 protected:
  CheckpointOnDisk() {
    for (const int iteration : {1, 2}) save(iteration);
  }
  void save(int iteration) const {
    Safetensors file;
    file.metadata["iteration"] = std::to_string(iteration);
    Tensor<float> numbers(Shape{100});
    numbers.fill(static_cast<float>(iteration));
    file.add("numbers", numbers);
    write_checkpoint(run_, file);
  }
  double newest() const {
    std::string note;
    return read_checkpoint(run_, note).number("iteration");
  }
  // What a save is refused with where the disk refuses its n-th call.
  std::string save_refused(int64_t n) const {
    const WatchedDisk disk({.file = run_.folder, .first = n});
    return refusal_of([&] { save(3); });
  }
  std::vector<std::string> calls_of_a_save() const {
    EXPECT_EQ(save_refused(0), "accepted");
    return WatchedDisk::calls();
  }

  const TempFolder folder_;
  const RunFolder run_{folder_ / "run"};
};

// So that where the power goes, a name stands for a whole file.
TEST_F(CheckpointOnDisk, IsSyncedBeforeItsNameChangesAndTheFolderAfter) {
  std::vector<std::string> calls = calls_of_a_save();
  calls.erase(std::unique(calls.begin(), calls.end()), calls.end());
  EXPECT_THAT(
      calls,
      ElementsAre("write checkpoint.new.safetensors.partial", "fsync checkpoint.new.safetensors.partial",
                  "rename checkpoint.new.safetensors.partial checkpoint.new.safetensors", "fsync run",
                  "rename checkpoint.previous.safetensors.link checkpoint.previous.safetensors",
                  "rename checkpoint.new.safetensors checkpoint.safetensors", "fsync run"));
}

TEST_F(CheckpointOnDisk, StandsWhicheverCallIsRefusedAndNoneIsHalfWritten) {
  const std::vector<std::string> calls = calls_of_a_save();
  for (size_t i = 0; i < calls.size(); ++i) {
    SCOPED_TRACE(calls[i]);
    for (const int iteration : {1, 2}) save(iteration);
    const std::string said = save_refused(static_cast<int64_t>(i) + 1);
    const bool is_write = calls[i].starts_with("write");
    EXPECT_THAT(said, AllOf(HasSubstr(run_.folder),
                            HasSubstr(is_write ? "No space left on device" : "Input/output error")));
    // The last call syncs the folder when all names are given.
    EXPECT_EQ(newest(), i + 1 == calls.size() ? 3 : 2);
    EXPECT_FALSE(fs::exists(run_.folder / "checkpoint.new.safetensors.partial"));
    // Nor is anything in the way of the next one.
    save(4);
    EXPECT_EQ(newest(), 4);
    EXPECT_THAT(names_in(run_.folder),
                ElementsAre("checkpoint.previous.safetensors", "checkpoint.safetensors"));
  }
}

class TrainingOnDisk : public Faults {
 protected:
  // The n-th call, and `count` in all, of a training to write or to sync its checkpoints.
  Outcome refuse(const std::string& call, int64_t first, int64_t count = 1) const {
    fs::remove_all(path("refused"));
    return run(training("refused"), {.disk = {"checkpoint", first, count, call}});
  }
  int64_t calls_of(const std::string& call) const { return disk_calls_said(refuse(call, count_only).error); }

  static void expect_nothing_saved(const Outcome& end, const char* why) {
    expect_one_line(end, 2);
    EXPECT_THAT(end.error, AllOf(HasSubstr("iteration 3 is not saved: "), HasSubstr(why)));
    EXPECT_EQ(files_in("refused"), (std::vector<std::string>{"log.jsonl"}));
  }
  static void expect_a_warning(const Outcome& end, const char* why) {
    EXPECT_EQ(end.code, 0) << end.error;
    EXPECT_EQ(lines(end.error), 1) << end.error;
    int warnings = 0;
    for (const nlohmann::json& event : logged("refused")) {
      if (event["event"] != "warning") continue;
      ++warnings;
      const std::string text = event["text"];
      EXPECT_THAT(text, AllOf(HasSubstr(" is not saved: "), HasSubstr(why), HasSubstr("tries again")));
      EXPECT_EQ(end.error, "warning: " + text + "\n") << "also of a quiet run";
    }
    EXPECT_EQ(warnings, 1);
    EXPECT_TRUE(state_of(path("refused")) == whole_state());
  }
  static void expect_the_one_before(const Outcome& end, const char* why) {
    expect_one_line(end, 2);
    EXPECT_THAT(end.error, AllOf(HasSubstr("iteration 24 is not saved: "), HasSubstr(why)));
    EXPECT_EQ(files_in("refused"), (std::vector<std::string>{"checkpoint.previous.safetensors",
                                                             "checkpoint.safetensors", "log.jsonl"}));
    EXPECT_EQ(iteration_saved("refused"), 21);
    EXPECT_EQ(run(resuming("refused")).code, 0);
    EXPECT_TRUE(state_of(path("refused")) == whole_state());
  }
};

TEST_F(TrainingOnDisk, ThatIsFullIsToldAndLeavesWhatStood) {
  const char* const why = "No space left on device";
  const int64_t writes = calls_of("write");
  ASSERT_GT(writes, 8 * 2);
  expect_nothing_saved(refuse("write", 1), why);
  expect_a_warning(refuse("write", writes / 2), why);
  expect_the_one_before(refuse("write", writes, all_that_follow), why);
}

TEST_F(TrainingOnDisk, ThatFailsToSyncIsToldAndLeavesWhatStood) {
  const char* const why = "Input/output error";
  const int64_t saves = iterations / 3;
  ASSERT_EQ(calls_of("fsync"), saves);
  expect_nothing_saved(refuse("fsync", 1), why);
  expect_a_warning(refuse("fsync", saves / 2), why);
  expect_the_one_before(refuse("fsync", saves), why);
}

TEST_F(TrainingOnDisk, ThatKnowsNoLocksIsToldAndTrainedOn) {
  const Outcome end = run(training("unlocked"), {.disk = {"unlocked/lock", 1, all_that_follow, "flock"}});
  EXPECT_EQ(end.code, 0) << end.error;
  EXPECT_TRUE(state_of(path("unlocked")) == whole_state());
  const std::string warning =
      path("unlocked") + " is on a file system without locks: see that no second training writes there";
  EXPECT_EQ(logged("unlocked")[0]["text"], warning);
  EXPECT_EQ(end.error, "warning: " + warning + "\n");
}

TEST_F(TrainingOnDisk, ThatIsFullForTheLogAloneLosesLinesAndCountsThem) {
  // The second line, how many are missing, the third, how many, the fourth.
  const Outcome end = run(training("gaps"), {.disk = {"log.jsonl", 2, 5, "write"}});
  EXPECT_EQ(end.code, 0) << end.error;
  EXPECT_EQ(end.error, "");
  EXPECT_TRUE(state_of(path("gaps")) == whole_state());
  const auto kinds = [](const std::string& run) {
    std::vector<std::string> result;
    for (const nlohmann::json& event : logged(run)) result.push_back(event["event"]);
    return result;
  };
  std::vector<std::string> expected = kinds("whole");
  expected.erase(expected.begin() + 1, expected.begin() + 3);
  expected[1] = "warning";
  EXPECT_EQ(kinds("gaps"), expected);
  EXPECT_EQ(logged("gaps")[1]["text"], "3 lines of the log could not be written here");
}

}  // namespace
}  // namespace traceflow::faults
