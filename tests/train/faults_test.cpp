#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>

#include "train/small_run.h"

#include "support/file_bytes.h"

// What happens to a training when the disk refuses and when photographs vanish (docs/faults.md). The program
// as a whole: tests/cli/faults.
namespace traceflow {
namespace {

using testing::AllOf;
using testing::HasSubstr;

fs::path new_run(const std::string& name) {
  fs::path run = fs::path(testing::TempDir()) / (name + "_" + std::to_string(::getpid()));
  fs::remove_all(run);
  return run;
}

std::string whole_bytes(const TrainOptions& options) {
  Trainer whole(options, load_capture(capture_folder(), options.capture), new_run("unhindered"));
  whole.run(never);
  return scene_bytes(whole.scene());
}

// Calls `act` after an iteration.
void after(Trainer& trainer, int64_t iteration, const std::function<void()>& act) {
  trainer.stream().listen([=](const events::Event& event) {
    const auto* step = std::get_if<events::Step>(&event);
    if (step != nullptr && step->iteration == iteration) act();
  });
}

TEST(TrainingFaults, ASaveThatTheDiskRefusesIsAWarningAndTriedAgain) {
  TrainOptions options = small_run(20);
  options.save_every = 5;
  const fs::path run = new_run("refusing");
  const fs::path in_the_way = run / "checkpoint.new.safetensors.partial";
  Trainer trainer(options, load_capture(capture_folder(), options.capture), run);
  std::vector<std::string> told;
  trainer.stream().listen([&](const events::Event& event) {
    if (const auto* saved = std::get_if<events::Saved>(&event))
      told.push_back("saved " + std::to_string(saved->iteration));
    const auto* warning = std::get_if<events::Warning>(&event);
    if (warning != nullptr && warning->text.find("not saved") != std::string::npos) {
      told.push_back("not saved " + std::to_string(warning->iteration));
      EXPECT_THAT(warning->text, AllOf(HasSubstr(in_the_way.parent_path().string()),
                                       HasSubstr("iteration 10 is not saved: "), HasSubstr("tries again")));
    }
  });
  after(trainer, 9, [&] { fs::create_directory(in_the_way); });
  after(trainer, 12, [&] { fs::remove(in_the_way); });
  EXPECT_EQ(trainer.run(never).ending, events::Ending::completed);
  EXPECT_EQ(told, (std::vector<std::string>{"saved 5", "not saved 10", "saved 15", "saved 20"}));
  EXPECT_EQ(scene_bytes(trainer.scene()), whole_bytes(options));
}

// A folder of which nothing can be said, not even what is in it: a connection that dropped.
TEST(TrainingFaults, AFolderThatIsAwayForOneSaveCostsThatSave) {
  TrainOptions options = small_run(20);
  options.save_every = 5;
  const fs::path run = new_run("dropped"), away = new_run("away");
  Trainer trainer(options, load_capture(capture_folder(), options.capture), run);
  std::vector<int64_t> refused;
  trainer.stream().listen([&](const events::Event& event) {
    const auto* warning = std::get_if<events::Warning>(&event);
    if (warning != nullptr && warning->text.find("not saved") != std::string::npos)
      refused.push_back(warning->iteration);
  });
  after(trainer, 9, [&] {
    fs::rename(run, away);
    fs::create_directory_symlink(run, run);
  });
  after(trainer, 12, [&] {
    fs::remove(run);
    fs::rename(away, run);
  });
  EXPECT_EQ(trainer.run(never).ending, events::Ending::completed);
  EXPECT_EQ(refused, std::vector<int64_t>{10});
  EXPECT_EQ(scene_bytes(trainer.scene()), whole_bytes(options));
}

TEST(TrainingFaults, AWorkingDirectoryThatIsGoneIsNotMissed) {
  TrainOptions options = small_run(12);
  const fs::path here = fs::current_path(), base = new_run("left_behind");
  fs::create_directories(base / "work");
  fs::copy(capture_folder(), base / "capture", fs::copy_options::recursive);
  fs::current_path(base / "work");
  const fs::path capture = fs::path("..") / "capture";
  Trainer trainer(options, load_capture(capture, options.capture), fs::path("..") / "run");
  after(trainer, 8, [&] { fs::remove(base / "work"); });  // when every photograph is in the cache
  const events::Finished end = trainer.run(never);
  fs::current_path(here);
  EXPECT_EQ(end.ending, events::Ending::completed);
  std::string note;
  const Safetensors saved = read_checkpoint(RunFolder{base / "run"}, note);
  EXPECT_EQ(saved.number("iteration"), 12);
  EXPECT_EQ(fs::path(saved.text("capture_folder")), fs::canonical(base / "capture"));
  fs::remove_all(base);
}

TEST(TrainingFaults, TheLastSaveRefusedIsAnErrorAndTheOneBeforeStands) {
  TrainOptions options = small_run(8);
  options.save_every = 5;
  const fs::path run = new_run("refused");
  Trainer trainer(options, load_capture(capture_folder(), options.capture), run);
  after(trainer, 7, [&] { fs::create_directory(run / "checkpoint.new.safetensors.partial"); });
  EXPECT_THROW(trainer.run(never), InputError);
  std::string note;
  EXPECT_EQ(read_checkpoint(RunFolder{run}, note).number("iteration"), 5);
}

TEST(TrainingFaults, ACaptureThatVanishesEndsInTheStateBeforeThatIteration) {
  TrainOptions options = small_run(20);
  options.capture.cache_mebibytes = 0;
  const fs::path fleeting = new_run("fleeting"), gone = new_run("gone"), run = new_run("vanished");
  fs::copy(capture_folder(), fleeting, fs::copy_options::recursive);
  {
    Trainer trainer(options, load_capture(fleeting, options.capture), run);
    after(trainer, 11, [&] { fs::rename(fleeting, gone); });
    const events::Finished end = trainer.run(never);
    EXPECT_EQ(end.ending, events::Ending::no_input);
    EXPECT_EQ(end.iteration, 11);
    EXPECT_THAT(end.reason, AllOf(HasSubstr(fleeting.string()), HasSubstr("No such file")));
  }
  fs::rename(gone, fleeting);
  Trainer resumed(options, load_capture(fleeting, options.capture), run);
  resumed.resume();
  EXPECT_EQ(resumed.iteration(), 11);
  EXPECT_EQ(resumed.run(never).ending, events::Ending::completed);
  EXPECT_EQ(scene_bytes(resumed.scene()), whole_bytes(options));
  fs::remove_all(fleeting);
}

// Lets a run's checkpoint say that its mean PSNR, of many views by now, was so and had been so at best.
void pretend_psnr(const RunFolder& run, double smoothed, double best) {
  Safetensors file = Safetensors::read(run.checkpoint());
  Tensor<double> health(Shape{3});
  health[0] = smoothed;
  health[1] = best;
  health[2] = 400;
  file.add("health", health);
  file.write(run.checkpoint());
}

// However often somebody saves a run whose PSNR falls, the state from before stays.
TEST(TrainingFaults, ACollapseDoesNotPushTheLastSoundStateOut) {
  TrainOptions options = small_run(20);
  options.deform.kind = "network";  // falls are expected where bodies are followed to new times
  options.collapse_decibels = 10;
  const RunFolder run{new_run("collapsing")};
  const auto stopped_at = [&](int iteration) {
    Trainer trainer(options, load_capture(capture_folder(), options.capture), run.folder);
    if (run.holds_a_run()) trainer.resume();
    std::atomic<bool> stop{false};
    after(trainer, iteration - 2, [&] { trainer.save(); });
    after(trainer, iteration - 1, [&] { trainer.save(); });
    after(trainer, iteration, [&] { stop = true; });
    trainer.run(stop);
    EXPECT_EQ(Safetensors::read(run.checkpoint()).number("iteration"), iteration);
  };
  stopped_at(6);
  // A mean PSNR far above what this run has: sound for the moment.
  pretend_psnr(run, 35.01, 40);
  stopped_at(9);
  EXPECT_EQ(Safetensors::read(run.previous_checkpoint()).number("iteration"), 6);
  stopped_at(12);
  EXPECT_EQ(Safetensors::read(run.previous_checkpoint()).number("iteration"), 6);
}

TEST(TrainingFaults, ACollapseWhileThingsMoveNamesSlowerFields) {
  TrainOptions options = small_run(20);
  options.collapse_decibels = 10;
  options.rates.field = 0.001F;
  options.rates.field_end = 0.0004F;
  for (const bool moves : {true, false}) {
    options.deform.main = moves;
    const RunFolder run{new_run("apart")};
    {
      Trainer first(options, load_capture(capture_folder(), options.capture), run.folder);
      std::atomic<bool> stop{false};
      after(first, 16, [&] { stop = true; });
      first.run(stop);
    }
    pretend_psnr(run, 31, 60);
    Trainer trainer(options, load_capture(capture_folder(), options.capture), run.folder);
    trainer.resume();
    const events::Finished end = trainer.run(never);
    EXPECT_EQ(end.ending, events::Ending::diverged);
    EXPECT_EQ(end.iteration, 17);
    EXPECT_THAT(end.reason, HasSubstr("the mean PSNR fell from 60"));
    EXPECT_EQ(end.reason.find("--set rates.field=0.00025 --set rates.field_end=0.0001") != std::string::npos,
              moves)
        << end.reason;
  }
}

// Checkpoints of version 1 had no checksums and are else the same.
TEST(TrainingFaults, ACheckpointOfAnEarlierVersionIsResumed) {
  const TrainOptions options = small_run(12);
  const fs::path run = new_run("earlier");
  {
    Trainer first(options, load_capture(capture_folder(), options.capture), run);
    std::atomic<bool> stop{false};
    after(first, 6, [&] { stop = true; });
    first.run(stop);
  }
  // The same file without its checksums and of version 1: both stand in the header alone.
  const RunFolder folder{run};
  std::string bytes = bytes_of(folder.checkpoint());
  const size_t name = bytes.find("traceflow.crc32"), version = bytes.find(R"("version":"2")");
  ASSERT_NE(name, std::string::npos);
  ASSERT_NE(version, std::string::npos);
  bytes[name] = 'T';
  bytes[version + 11] = '1';
  write_bytes(folder.checkpoint(), bytes);
  ASSERT_FALSE(Safetensors::read(folder.checkpoint()).has_checksums());

  Trainer resumed(options, load_capture(capture_folder(), options.capture), run);
  resumed.resume();
  EXPECT_EQ(resumed.iteration(), 6);
  resumed.run(never);
  EXPECT_EQ(scene_bytes(resumed.scene()), whole_bytes(options));
}

}  // namespace
}  // namespace traceflow
