#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <ctime>
#include <nlohmann/json.hpp>
#include <thread>

#include "cli/faults/small_training.h"

// A full disk, a folder that may not be written to, a capture that vanishes, a clock that jumps, a terminal
// that is gone, a second training: what the program says, how it ends, and what it leaves (docs/faults.md).
namespace traceflow::faults {
namespace {

using testing::AllOf;
using testing::HasSubstr;

// Files larger than this do not fit: captures do, checkpoints do not.
constexpr int64_t small_disk = 40'000;

void wait_for(const fs::path& path, Process& process) {
  while (!fs::exists(path) && !process.has_ended()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

TEST_F(Faults, ADiskThatIsFullFromTheStartLeavesNoPartOfACheckpoint) {
  const Outcome end = run(training("full"), {.file_bytes = small_disk});
  expect_one_line(end, 2);
  EXPECT_THAT(end.error, AllOf(HasSubstr("iteration 3 is not saved: "), HasSubstr("File too large")));
  EXPECT_EQ(files_in("full"), (std::vector<std::string>{"log.jsonl"}));
}

TEST_F(Faults, ADiskThatIsFullWhenARunGoesOnLeavesItsCheckpointsAsTheyWere) {
  ASSERT_EQ(run(training("filled", {"-i", "6"})).code, 0);
  const std::string current = bytes_of(run_in("filled").checkpoint()),
                    previous = bytes_of(run_in("filled").previous_checkpoint());
  std::vector<std::string> words = resuming("filled");
  words.insert(words.end(), {"-i", "12"});
  const Outcome end = run(words, {.file_bytes = small_disk});
  EXPECT_EQ(end.code, 2);
  EXPECT_EQ(lines(end.error), 2) << end.error;
  EXPECT_THAT(end.error, AllOf(HasSubstr("warning: iteration 9 is not saved: "),
                               HasSubstr("\ntraceflow: iteration 12 is not saved: ")));
  EXPECT_EQ(bytes_of(run_in("filled").checkpoint()), current);
  EXPECT_EQ(bytes_of(run_in("filled").previous_checkpoint()), previous);
  EXPECT_EQ(files_in("filled"), (std::vector<std::string>{"checkpoint.previous.safetensors",
                                                          "checkpoint.safetensors", "log.jsonl"}));
}

TEST_F(Faults, AFolderThatMayNotBeWrittenToIsSaidBeforeTrainingBegins) {
  fs::create_directory(path("closed"));
  fs::permissions(path("closed"), fs::perms::owner_read | fs::perms::owner_exec | fs::perms::others_exec |
                                      fs::perms::others_read);
  const Outcome there = run(training("closed"), {.is_nobody = true});
  expect_one_line(there, 2);
  EXPECT_THAT(there.error, AllOf(HasSubstr(path("closed")), HasSubstr("Permission denied")));
  const Outcome inside = run(training("closed/new"), {.is_nobody = true});
  expect_one_line(inside, 2);
  EXPECT_THAT(inside.error, HasSubstr("Permission denied"));
  EXPECT_TRUE(fs::is_empty(path("closed")));
}

TEST_F(Faults, ACaptureThatVanishesEndsTheTrainingInASavedState) {
  fs::copy(path("capture"), path("fleeting"), fs::copy_options::recursive);
  std::vector<std::string> words = training("lost", {"-i", "100000", "--set", "capture.cache_mebibytes=0"});
  words[2] = path("fleeting");
  Process training(words, {});
  wait_for(run_in("lost").checkpoint(), training);
  fs::rename(path("fleeting"), path("gone"));
  const Outcome end = training.wait();
  expect_one_line(end, 2);
  EXPECT_THAT(end.error, AllOf(HasSubstr(path("fleeting")), HasSubstr("No such file")));
  std::string note;
  const double reached = read_checkpoint(run_in("lost"), note).number("iteration");
  EXPECT_GE(reached, 3);
  EXPECT_EQ(note, "");

  // While it is away, and when it is back.
  expect_one_line(run(resuming("lost")), 2);
  fs::rename(path("gone"), path("fleeting"));
  std::vector<std::string> again = resuming("lost");
  again.insert(again.end(), {"-i", std::to_string(static_cast<int>(reached) + 2)});
  EXPECT_EQ(run(again).code, 0);
}

TEST_F(Faults, AClockThatJumpsChangesNothing) {
  const Outcome end = run(training("timeless"), {.clock_jumps = true});
  EXPECT_EQ(end.code, 0) << end.error;
  EXPECT_TRUE(state_of(path("timeless")) == whole_state());
  // Times in the log are spans, and spans are not negative.
  double last = 0;
  for (const nlohmann::json& json : logged("timeless")) {
    if (json["event"] != "step") continue;
    EXPECT_GE(json["seconds"].get<double>(), last);
    EXPECT_LT(json["seconds"].get<double>(), 1e4);
    last = json["seconds"];
  }
  const Outcome report = run({"report", path("timeless"), "--device", "cpu"}, {.clock_jumps = true});
  EXPECT_EQ(report.code, 0) << report.error;
}

TEST_F(Faults, ASecondTrainingIsKeptOutAndReadersAreNot) {
  Process first(training("held", {"-i", "100000"}), {});
  wait_for(run_in("held").checkpoint(), first);
  std::vector<std::string> resumed = resuming("held");
  resumed.insert(resumed.end(), {"-i", "1"});  // no further, should it be let in
  for (const std::vector<std::string>& words : {resumed, training("held")}) {
    const Outcome second = run(words);
    expect_one_line(second, 2);
    EXPECT_THAT(second.error, AllOf(HasSubstr(path("held")), HasSubstr("process "), HasSubstr(" on ")));
  }
  EXPECT_EQ(run({"export", path("held"), "-o", path("held_ply")}).code, 0);

  // The lock goes with whoever held it, however it ends.
  ASSERT_FALSE(first.has_ended());
  first.send(SIGKILL);
  first.wait();
  EXPECT_TRUE(fs::exists(run_in("held").lock()));
  std::string note;
  const auto reached = static_cast<int>(read_checkpoint(run_in("held"), note).number("iteration"));
  std::vector<std::string> words = resuming("held");
  words.insert(words.end(), {"-i", std::to_string(reached + 1)});
  const Outcome next = run(words);
  EXPECT_EQ(next.code, 0) << next.error;
  EXPECT_FALSE(fs::exists(run_in("held").lock()));
}

TEST_F(Faults, ATrainingOutlivesWhatItTalksTo) {
  const std::vector<World> worlds{{.error = "/dev/full"}, {.output_closed = true, .error_closed = true}};
  for (const World& world : worlds) {
    fs::remove_all(path("silent"));
    std::vector<std::string> words = training("silent");
    words.erase(std::find(words.begin(), words.end(), "-q"));
    EXPECT_EQ(run(words, world).code, 0);
    EXPECT_TRUE(state_of(path("silent")) == whole_state());
    EXPECT_EQ(logged("silent").back()["ending"], "completed");
  }
}

// As `traceflow train 2>&1 | less` when less is left.
TEST_F(Faults, ATrainingOutlivesWhoReadsWhatItSays) {
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0666), 0);
  const int reader = ::open(path("pipe").c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  std::vector<std::string> words = training("unheard");
  words.erase(std::find(words.begin(), words.end(), "-q"));
  Process process(words, {.error = path("pipe")});
  wait_for(run_in("unheard").checkpoint(), process);
  ::close(reader);
  EXPECT_EQ(process.wait().code, 0);
  EXPECT_TRUE(state_of(path("unheard")) == whole_state());
}

TEST_F(Faults, ASignalToStopEndsTheTrainingInASavedState) {
  const RunFolder stopped = run_in("stopped");
  for (const int signal_number : {SIGINT, SIGTERM, SIGHUP}) {
    SCOPED_TRACE(signal_number);
    fs::remove_all(stopped.folder);
    Process training(this->training("stopped", {"-i", "100000"}), {});
    wait_for(stopped.checkpoint(), training);
    training.send(signal_number);
    const Outcome end = training.wait();
    EXPECT_EQ(end.code, 130);
    EXPECT_EQ(end.error, "");
    const nlohmann::json last = logged("stopped").back();
    EXPECT_EQ(last["event"], "finished");
    EXPECT_EQ(last["ending"], "interrupted");
    EXPECT_EQ(last["iteration"], iteration_saved("stopped"));
  }
}

TEST_F(Faults, UnderNohupATrainingOutlivesItsTerminal) {
  Process training(this->training("nohup", {"-i", "100000"}), {.hangup_ignored = true});
  wait_for(run_in("nohup").checkpoint(), training);
  training.send(SIGHUP);
  // Past two more checkpoints: one might have been due before the signal came.
  const double then = iteration_saved("nohup");
  while (iteration_saved("nohup") < then + 6 && !training.has_ended())
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  ASSERT_FALSE(training.has_ended());
  training.send(SIGTERM);
  EXPECT_EQ(training.wait().code, 130);
}

TEST_F(Faults, OutputThatFindsNoRoomIsAnError) {
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"inspect", "-d", path("capture")}, {"--help-options"}, {"--version"}}) {
    const Outcome end = run(words, {.output = "/dev/full"});
    EXPECT_EQ(end.code, 2) << words[0];
    EXPECT_EQ(lines(end.error), 1) << end.error;
    EXPECT_THAT(end.error, HasSubstr("No space left on device"));
  }
}

// Verbs that read a run: one that is damaged is named by its section, and the one before it serves.
TEST_F(Faults, ADamagedCheckpointIsNamedByItsSectionAndTheOneBeforeServes) {
  fs::copy(path("whole"), path("damaged"), fs::copy_options::recursive);
  const RunFolder damaged = run_in("damaged");
  std::string bytes = bytes_of(damaged.checkpoint());
  const size_t middle = bytes.size() - 5;
  bytes[middle] = static_cast<char>(bytes[middle] ^ 1);
  std::ofstream(damaged.checkpoint(), std::ios::binary) << bytes;
  const auto says_so = AllOf(HasSubstr("checkpoint.safetensors: tensor "), HasSubstr("damaged"),
                             HasSubstr("using the checkpoint before it, of iteration 21"));
  const std::vector<std::vector<std::string>> readers{
      {"export", path("damaged"), "-o", path("damaged_ply")},
      {"eval", path("damaged"), "--device", "cpu"},
      {"report", path("damaged"), "--device", "cpu"},
      {"render", path("damaged"), "-o", path("damaged_pictures"), "--device", "cpu"}};
  for (const std::vector<std::string>& words : readers) {
    const Outcome end = run(words);
    EXPECT_EQ(end.code, 0) << words[0] << end.error;
    EXPECT_THAT(end.error, says_so) << words[0];
  }
  // A training goes on from the one before, keeps the damaged one out of the way, and ends in the same bytes.
  std::vector<std::string> aloud = resuming("damaged");
  aloud.erase(std::find(aloud.begin(), aloud.end(), "-q"));
  const Outcome resumed = run(aloud);
  EXPECT_EQ(resumed.code, 0);
  EXPECT_THAT(resumed.error, says_so);
  EXPECT_EQ(bytes_of(damaged.damaged_checkpoint()), bytes);
  EXPECT_TRUE(state_of(path("damaged")) == whole_state());

  // With no other to go back to, all say one line.
  fs::remove(damaged.previous_checkpoint());
  std::ofstream(damaged.checkpoint(), std::ios::binary) << bytes;
  for (const std::vector<std::string>& words : readers) expect_one_line(run(words), 2);
  expect_one_line(run(resuming("damaged")), 2);
}

TEST_F(Faults, ACheckpointOfANewerVersionIsRefusedByEveryVerb) {
  fs::copy(path("whole"), path("newer"), fs::copy_options::recursive);
  Safetensors file = Safetensors::read(run_in("newer").checkpoint());
  file.metadata["version"] = "3";
  file.write(run_in("newer").checkpoint());
  for (const std::vector<std::string>& words :
       {resuming("newer"),
        {"export", path("newer"), "-o", path("newer_ply")},
        {"eval", path("newer"), "--device", "cpu"},
        {"report", path("newer"), "--device", "cpu"},
        {"render", path("newer"), "-o", path("newer_pictures"), "--device", "cpu"},
        {"view", path("newer"), "--device", "cpu"}}) {
    const Outcome end = run(words);
    expect_one_line(end, 2);
    EXPECT_THAT(end.error, HasSubstr("version: found 3, expected at most 2; a newer traceflow wrote it"));
  }
}

}  // namespace
}  // namespace traceflow::faults
