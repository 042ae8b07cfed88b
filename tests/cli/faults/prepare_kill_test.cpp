#include <chrono>
#include <csignal>
#include <iostream>
#include <map>
#include <set>
#include <thread>

#include "base/random.h"
#include "cli/faults/small_training.h"
#include "prepare/prepare_case.h"

// `kill -9` of a preparation at random moments, with the scripts of prepare_case.h in the place of ffmpeg and
// COLMAP. As Kill, of trainings.
namespace traceflow::faults {
namespace {

using prepare::Step;
using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

class PrepareKill : public prepare::PrepareTest {
 protected:
  PrepareKill() : masks_(write_masks(64, 40)) {}

  std::vector<std::string> words(const fs::path& to) const {
    return {"prepare", film(),          "-o",           to.string(), "--frames",  std::to_string(frames),
            "--masks", masks_.string(), "--test-every", "4",         "--threads", "2"};
  }

  std::set<Step> steps_that_stand() const {
    std::set<Step> standing;
    for (const Step step :
         {Step::frames, Step::masks, Step::features, Step::matches, Step::poses, Step::capture}) {
      if (fs::exists(prepare::work_folder(capture()) / (prepare::step_name(step) + ".json"))) {
        standing.insert(step);
      }
    }
    return standing;
  }

  // Which steps called a program.
  std::set<Step> steps_at_work() const {
    std::set<Step> working;
    std::ifstream file(folder_ / "calls");
    for (std::string line; std::getline(file, line);) {
      if (line.starts_with("ffmpeg"))
        working.insert(line.find(film()) == std::string::npos ? Step::masks : Step::frames);
      if (line.starts_with("colmap feature_extractor")) working.insert(Step::features);
      if (line.starts_with("colmap exhaustive_matcher")) working.insert(Step::matches);
      if (line.starts_with("colmap mapper")) working.insert(Step::poses);
    }
    return working;
  }

  // Path and bytes of all files but prepare.json, which says how long it took.
  static std::map<std::string, std::string> contents_of(const fs::path& folder) {
    std::map<std::string, std::string> contents;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      const std::string name = entry.path().lexically_relative(folder).string();
      if (entry.is_regular_file() && name != "prepare.json") contents[name] = bytes_of(entry.path());
    }
    return contents;
  }

  fs::path masks_;
};

TEST_F(PrepareKill, NoStepIsDoneTwiceAndTheCaptureIsWholeOrNotThere) {
  const Clock::time_point start = Clock::now();
  const Outcome undisturbed = run(words(folder_ / "whole"));
  ASSERT_EQ(undisturbed.code, 0) << undisturbed.error;
  const double usual = Seconds(Clock::now() - start).count();
  const std::map<std::string, std::string> whole = contents_of(folder_ / "whole");
  ASSERT_TRUE(whole.contains("mask/1x/000003.png.png"));

  const int wanted = number_from_environment("TRACEFLOW_KILLS", 4);
  Random random{20261123};
  int kills = 0, captures = 0;
  std::map<size_t, int> kills_after;  // so many steps
  while (kills < wanted || captures == 0) {
    const std::set<Step> standing = steps_that_stand();
    fs::remove(folder_ / "calls");
    Process preparation(words(capture()), {});
    const Seconds wait(random.uniform() * usual);
    const Clock::time_point begin = Clock::now();
    while (kills < wanted && !preparation.has_ended() && Clock::now() - begin < wait) {
      std::this_thread::sleep_for(std::chrono::microseconds(500));
    }
    if (kills < wanted && !preparation.has_ended()) preparation.send(SIGKILL);
    const Outcome end = preparation.wait();
    // A program that a kill left behind keeps the lock until it has ended.
    if (end.code == 2 && end.error.find("preparing in it") != std::string::npos) continue;

    for (const Step step : steps_at_work()) EXPECT_FALSE(standing.contains(step)) << prepare::step_name(step);
    EXPECT_TRUE(!fs::exists(capture()) || contents_of(capture()) == whole);
    if (end.code == -SIGKILL) {
      ++kills;
      ++kills_after[steps_that_stand().size()];
    } else {
      ASSERT_EQ(end.code, 0) << end.error;
      EXPECT_TRUE(fs::exists(capture()));
      ++captures;
      fs::remove_all(capture());
      fs::remove_all(prepare::work_folder(capture()));
    }
    if (HasFailure()) return;
  }
  std::cout << kills << " kills in " << Seconds(Clock::now() - start).count() << " s";
  for (const auto& [steps, times] : kills_after) std::cout << ", " << times << " after " << steps << " steps";
  std::cout << "; " << captures << " captures, of the same bytes\n";
}

}  // namespace
}  // namespace traceflow::faults
