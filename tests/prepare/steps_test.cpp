#include "prepare/steps.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "support/temp_folder.h"

namespace traceflow::prepare {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::MatchesRegex;

// Three steps, of which it is noted which were done.
class StepsTest : public testing::Test {
 protected:
  std::vector<std::string> run(int masks_input = 1, bool frames_stand = true, int failing = -1) {
    done_.clear();
    lines_.clear();
    Steps steps(folder_.path(), [this](const std::string& line) { lines_.push_back(line); });
    const auto work = [&](Step step) {
      return [this, step, failing] {
        done_.push_back(step_name(step));
        if (static_cast<int>(step) == failing) throw InputError("film", "", "nothing", "something");
        return "found by " + step_name(step);
      };
    };
    steps.run(
        Step::frames, 7, [=] { return frames_stand; }, work(Step::frames));
    steps.run(
        Step::masks, masks_input, [] { return true; }, work(Step::masks));
    steps.run(
        Step::features, {{"a", 1}}, [] { return true; }, work(Step::features));
    return done_;
  }

  TempFolder folder_;
  std::vector<std::string> done_, lines_;
};

TEST_F(StepsTest, AreDoneOnce) {
  EXPECT_THAT(run(), ElementsAre("frames", "masks", "features"));
  EXPECT_THAT(lines_[1], MatchesRegex("masks     found by masks \\([0-9]+ s\\)"));
  EXPECT_THAT(run(), IsEmpty());
  EXPECT_EQ(lines_[1], "masks     found by masks (stands)");
}

TEST_F(StepsTest, AChangeDoesItsStepAndAllAfterAgain) {
  run();
  EXPECT_THAT(run(2), ElementsAre("masks", "features"));
  EXPECT_THAT(run(2), IsEmpty());
  EXPECT_THAT(run(2, false), ElementsAre("frames", "masks", "features"));
}

TEST_F(StepsTest, AFailureIsDoneAgainAndNothingBeforeIt) {
  EXPECT_THROW(run(1, true, static_cast<int>(Step::masks)), InputError);
  EXPECT_THAT(run(), ElementsAre("masks", "features"));
}

TEST_F(StepsTest, AFailedChangeLeavesNoOldStampBehind) {
  run();
  EXPECT_THROW(run(2, true, static_cast<int>(Step::masks)), InputError);
  EXPECT_THAT(run(1), ElementsAre("masks", "features"));
}

TEST_F(StepsTest, AStampThatCannotBeReadCountsAsNone) {
  run();
  for (const char* text :
       {"", "{", "[1]", R"({"inputs": 1})", R"({"inputs": 1, "found": 3, "seconds": 1})"}) {
    std::ofstream(folder_ / "masks.json") << text;
    EXPECT_THAT(run(), ElementsAre("masks", "features")) << text;
  }
}

TEST_F(StepsTest, AFileIsAnotherWhenItsBytesOrItsTimeChange) {
  std::ofstream(folder_ / "film") << "abc";
  const auto before = identity_of(folder_ / "film");
  EXPECT_EQ(before, identity_of(folder_ / "film"));
  std::ofstream(folder_ / "film") << "abcd";
  EXPECT_NE(before, identity_of(folder_ / "film"));
  std::filesystem::create_directory(folder_ / "d");
  const auto empty = identity_of(folder_ / "d");
  std::ofstream(folder_ / "d/one.png") << "1";
  EXPECT_NE(empty, identity_of(folder_ / "d"));
}

// Notes that a program leaves among the pictures do not make hours of work void.
TEST_F(StepsTest, AFolderIsAnotherWhenItsPicturesChange) {
  const std::filesystem::path pictures = folder_ / "d";
  std::filesystem::create_directory(pictures);
  for (const char* name : {"9.png", "10.jpg"}) std::ofstream(pictures / name) << name;
  const auto before = identity_of(pictures);
  // By letter, as stamps have it that stand.
  ASSERT_EQ(before.size(), 2U);
  EXPECT_EQ(before.at(0), identity_of(pictures / "10.jpg"));
  EXPECT_EQ(before.at(1), identity_of(pictures / "9.png"));
  for (const char* name : {"masks.log", ".DS_Store", "._9.png"}) std::ofstream(pictures / name) << name;
  EXPECT_EQ(before, identity_of(pictures));
  std::ofstream(pictures / "9.png") << "another";
  EXPECT_NE(before, identity_of(pictures));
}

}  // namespace
}  // namespace traceflow::prepare
