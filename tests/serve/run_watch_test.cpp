#include "serve/run_watch.h"

#include <gtest/gtest.h>

#include <fstream>

#include "support/temp_folder.h"

namespace traceflow::serve {
namespace {

namespace fs = std::filesystem;

// A run's folder with checkpoints that nobody reads: versions differ in length.
struct WatchedFolder {
  void save(size_t length) const { std::ofstream(run.checkpoint()) << std::string(length, 'x'); }
  // "saved", "vanished" or nothing.
  static std::string seen_by(RunWatch& watch) {
    const RunWatch::Change change = watch.poll();
    return std::string(change.saved ? "saved" : "") + (change.vanished ? "vanished" : "");
  }

  TempFolder folder;
  RunFolder run{folder.path()};
};

TEST(RunWatch, SeesWhatIsSavedUntilItIsAccepted) {
  const WatchedFolder f;
  f.save(1);
  RunWatch watch(f.run);
  EXPECT_EQ(f.seen_by(watch), "") << "what is there at first is known";
  f.save(2);
  EXPECT_EQ(f.seen_by(watch), "saved");
  EXPECT_EQ(f.seen_by(watch), "saved") << "not read";
  watch.accept();
  EXPECT_EQ(f.seen_by(watch), "");
  f.save(3);
  EXPECT_EQ(f.seen_by(watch), "saved");
}

TEST(RunWatch, ACheckpointThatComesWhileOneIsReadIsSeen) {
  const WatchedFolder f;
  f.save(1);
  RunWatch watch(f.run);
  f.save(2);
  EXPECT_EQ(f.seen_by(watch), "saved");
  f.save(3);
  watch.accept();
  EXPECT_EQ(f.seen_by(watch), "saved");
}

TEST(RunWatch, SeesAFileOfTheSameLengthInItsPlace) {
  const WatchedFolder f;
  f.save(5);
  RunWatch watch(f.run);
  std::ofstream(f.folder / "other") << "other";
  fs::last_write_time(f.folder / "other", fs::last_write_time(f.run.checkpoint()) + std::chrono::seconds(1));
  fs::rename(f.folder / "other", f.run.checkpoint());
  EXPECT_EQ(f.seen_by(watch), "saved");
}

TEST(RunWatch, SeesARunGoAndComeBack) {
  const WatchedFolder f;
  f.save(1);
  RunWatch watch(f.run);
  fs::rename(f.run.checkpoint(), f.folder / "away");
  EXPECT_EQ(f.seen_by(watch), "vanished");
  EXPECT_EQ(f.seen_by(watch), "vanished");
  fs::rename(f.folder / "away", f.run.checkpoint());
  EXPECT_EQ(f.seen_by(watch), "") << "the same as before";
  fs::remove(f.run.checkpoint());
  EXPECT_EQ(f.seen_by(watch), "vanished");
  f.save(2);
  EXPECT_EQ(f.seen_by(watch), "saved");
}

TEST(RunWatch, ACheckpointThatIsJustBeingRenamedIsNotGone) {
  const WatchedFolder f;
  f.save(1);
  RunWatch watch(f.run);
  fs::rename(f.run.checkpoint(), f.run.previous_checkpoint());
  EXPECT_EQ(f.seen_by(watch), "");
  f.save(2);
  EXPECT_EQ(f.seen_by(watch), "saved");
}

}  // namespace
}  // namespace traceflow::serve
