#include "prepare/choose_frames.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <atomic>
#include <cmath>
#include <fstream>

#include "base/error.h"
#include "base/process.h"
#include "prepare/frames.h"
#include "prepare/masks.h"
#include "prepare/netpbm.h"
#include "prepare/picture_source.h"
#include "prepare/programs.h"
#include "support/refusal.h"
#include "support/temp_folder.h"

namespace traceflow::prepare {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::vector<Candidate> film(int count, double rate, const std::function<double(int)>& sharp) {
  std::vector<Candidate> candidates;
  candidates.reserve(static_cast<size_t>(count));
  for (int i = 0; i < count; ++i) candidates.push_back({i / rate, sharp(i)});
  return candidates;
}

TEST(ChooseFrames, TakesTheSharpestOfEachInterval) {
  PrepareOptions options;
  options.frames = 10;
  const auto candidates = film(30, 30, [](int i) { return i % 3 == i / 10 ? 2.0 : 1.0; });
  EXPECT_THAT(choose_frames(candidates, options), ElementsAre(0, 3, 6, 9 + 0, 13, 16, 19, 23, 26, 29));
}

TEST(ChooseFrames, TakesAllWhereThereAreNoMore) {
  PrepareOptions options;
  options.frames = 10;
  EXPECT_EQ(choose_frames(film(10, 5, [](int) { return 1.0; }), options).size(), 10U);
  EXPECT_TRUE(choose_frames({}, options).empty());
}

TEST(ChooseFrames, ARateCountsSecondsNotPictures) {
  PrepareOptions options;
  options.rate = 2;
  // A frame rate that changes: 10 pictures in the first second, 3 in the second, none in the third, 1 in the
  // fourth.
  std::vector<Candidate> candidates = film(10, 10, [](int) { return 1.0; });
  for (const double time : {1.0, 1.4, 1.6, 3.2}) candidates.push_back({time, 1});
  EXPECT_THAT(choose_frames(candidates, options), ElementsAre(0, 5, 10, 12, 13));
}

TEST(ChooseFrames, StartAndEndLeaveTheRestOut) {
  PrepareOptions options;
  options.start = 1;
  options.end = 2;
  EXPECT_THAT(choose_frames(film(40, 10, [](int) { return 1.0; }), options), testing::SizeIs(11));
}

RC_GTEST_PROP(ChooseFrames, RisesAndGivesAboutAsManyAsAsked, ()) {
  PrepareOptions options;
  options.frames = *rc::gen::inRange(10, 60);
  const auto gaps = *rc::gen::container<std::vector<int>>(200, rc::gen::inRange(1, 4));
  std::vector<Candidate> candidates;
  double time = 5;
  candidates.reserve(gaps.size());
  for (const int gap : gaps) candidates.push_back({time += gap * 0.01, static_cast<double>(gap)});
  const std::vector<int64_t> chosen = choose_frames(candidates, options);
  RC_ASSERT(std::adjacent_find(chosen.begin(), chosen.end(), std::greater_equal<>()) == chosen.end());
  RC_ASSERT(static_cast<int>(chosen.size()) <= options.frames);
  RC_ASSERT(static_cast<int>(chosen.size()) >= options.frames - 1);
}

TEST(NearestFrames, AreWithinTheTolerance) {
  const std::vector<Candidate> candidates{{0.0, 0}, {0.5, 0}, {1.1, 0}};
  EXPECT_THAT(nearest_frames(candidates, {0.1, 0.45, 0.8, 1.0, 9.0}, 0.2), ElementsAre(0, 1, -1, 2, -1));
  EXPECT_THAT(nearest_frames({}, {1.0}, 5), ElementsAre(-1));
}

TEST(NearestFrames, GiveEachCandidateOnceToTheNearestTime) {
  const std::vector<Candidate> candidates{{2.0, 0}, {5.0, 0}};
  EXPECT_THAT(nearest_frames(candidates, {0.5, 1.6, 2.2, 2.9, 4.0}, 3), ElementsAre(-1, -1, 0, -1, 1));
}

TEST(PicturesIn, CountAsPeopleDo) {
  const TempFolder folder;
  for (const char* name : {"f10.png", "f9.JPG", "f09b.png", "f1.tiff", "notes.txt", "g.png"})
    std::ofstream(folder / name) << "x";
  std::vector<std::string> names;
  for (const auto& path : pictures_in(folder.path())) names.push_back(path.filename().string());
  EXPECT_THAT(names, ElementsAre("f1.tiff", "f9.JPG", "f09b.png", "f10.png", "g.png"));
}

TEST(PicturesIn, LeaveOutWhatIsHidden) {
  const TempFolder folder;
  for (const char* name : {"._IMG_1.jpg", ".IMG_2.png", "IMG_1.jpg"}) std::ofstream(folder / name) << "x";
  std::vector<std::string> names;
  for (const auto& path : pictures_in(folder.path())) names.push_back(path.filename().string());
  EXPECT_THAT(names, ElementsAre("IMG_1.jpg"));
}

const std::atomic<bool> never = false;

NetpbmStream stream_of(const std::string& bytes) {
  Pipe pipe = make_pipe();
  EXPECT_EQ(::write(pipe.writing.number(), bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  pipe.writing.close();
  return {std::move(pipe.reading), "film", never};
}

TEST(Netpbm, ReadsPicturesOneAfterTheOther) {
  NetpbmStream stream = stream_of("P5\n2 1\n255\nabP6\n1 2\n255\nabcdef");
  const auto grey = stream.next(), colour = stream.next();
  ASSERT_TRUE(grey && colour);
  EXPECT_EQ(grey->shape(), (Shape{1, 2, 1}));
  EXPECT_EQ((*grey)[1], 'b');
  EXPECT_EQ(colour->shape(), (Shape{2, 1, 3}));
  EXPECT_EQ((*colour)[5], 'f');
  EXPECT_FALSE(stream.next());
}

TEST(Netpbm, RefusesWhatIsCutShortOrElse) {
  for (const std::string& bytes :
       {std::string("P5\n2 1\n255\na"), std::string("P5\n2 1\n65535\nabcd"),
        std::string("P5\n99999 1\n255\n"), std::string("P5\n0 1\n255\n"), std::string("P5\nx"),
        std::string("P3\n1 1\n255\n1"), std::string("hello"), std::string("P")}) {
    NetpbmStream stream = stream_of(bytes);
    EXPECT_THROW(stream.next(), InputError) << bytes;
  }
}

TEST(Netpbm, AStopEndsTheWaitForASilentProgram) {
  Pipe pipe = make_pipe();
  const std::atomic<bool> stop = true;
  NetpbmStream stream(std::move(pipe.reading), "film", stop);
  EXPECT_THROW(stream.next(), Stopped);
}

Frames some_frames() {
  Frames frames;
  frames.source_frames = {7};
  for (const int64_t i : {1, 3, 6}) {
    frames.frames.push_back({"00000" + std::to_string(frames.frames.size()), 0,
                             "photo" + std::to_string(i) + ".jpg", i, 0.25 * static_cast<double>(i), 9.5, 8,
                             6});
  }
  return frames;
}

TEST(Frames, AreReadAsTheyWereWritten) {
  const TempFolder folder;
  write_frames(folder / "list.json", some_frames());
  const Frames frames = read_frames(folder / "list.json");
  EXPECT_THAT(frames.source_frames, ElementsAre(7));
  ASSERT_EQ(frames.frames.size(), 3U);
  EXPECT_EQ(frames.frames[2].id, "000002");
  EXPECT_EQ(frames.frames[2].source, "photo6.jpg");
  EXPECT_EQ(frames.frames[2].index, 6);
  EXPECT_EQ(frames.frames[2].time, 1.5);
  EXPECT_EQ(frames.frames[2].height, 6);
}

using Matched = std::vector<std::optional<int64_t>>;

TEST(MatchMasks, ByFrameBySourceOrByOrder) {
  const Frames frames = some_frames();
  EXPECT_EQ(match_masks("m", {"000000.png", "000001.png", "000002.png"}, 3, frames), (Matched{0, 1, 2}));
  EXPECT_EQ(match_masks("m", {"other.png", "photo1.png", "photo3.png.png", "photo6.jpg"}, 4, frames),
            (Matched{1, 2, 3}));
  EXPECT_EQ(match_masks("m", {"a", "b", "c"}, 3, frames), (Matched{0, 1, 2}));
  EXPECT_EQ(match_masks("m", {}, 7, frames), (Matched{1, 3, 6}));
  try {
    match_masks("m", {"000000.png", "b"}, 2, frames);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(
        error.what(),
        HasSubstr(
            "m: masks: found 2, not all of them with a frame's name, expected one for each of 3 frames"));
  }
}

std::vector<std::string> numbered(int64_t first, int64_t count) {
  std::vector<std::string> names;
  for (int64_t i = first; i < first + count; ++i) names.push_back(fmt::format("{:06}.png", i));
  return names;
}

// A film's pictures and its frames are both named by numbers of six digits.
TEST(MatchMasks, NumbersOfAFilmsPicturesAreNotThoseOfItsFrames) {
  Frames frames = some_frames();
  for (Frame& frame : frames.frames) frame.source.clear();
  EXPECT_EQ(match_masks("m", numbered(0, 7), 7, frames), (Matched{1, 3, 6}));
  EXPECT_EQ(match_masks("m", numbered(0, 3), 3, frames), (Matched{0, 1, 2}));
  EXPECT_EQ(match_masks("m", numbered(0, 5), 5, frames), (Matched{0, 1, 2}));
}

TEST(MatchMasks, NumbersOfAFoldersPicturesAreNotThoseOfItsFrames) {
  Frames frames = some_frames();
  for (Frame& frame : frames.frames) frame.source = fmt::format("{:06}.png", frame.index);
  EXPECT_EQ(match_masks("m", numbered(1, 6), 6, frames), (Matched{0, 2, 5}));
  EXPECT_EQ(match_masks("m", numbered(0, 3), 3, frames), (Matched{0, 1, 2}));
}

TEST(MatchMasks, TheSecondCamerasNamesDoNotMakeUpForTheFirsts) {
  Frames frames = some_frames();
  frames.source_frames.push_back(7);
  for (Frame& frame : frames.frames) frame.source.clear();
  frames.frames.push_back({"000001_right", 1, "", 2, 0.25, 9.5, 8, 6});
  EXPECT_THROW(match_masks("m", {"000000.png", "000001.png", "000001_right.png", "x.png"}, 4, frames),
               InputError);
  EXPECT_EQ(match_masks("m", {"000000.png", "000001.png", "000002.png", "000001_right.png"}, 4, frames),
            (Matched{0, 1, 2, 3}));
  EXPECT_EQ(match_masks("m", numbered(0, 3), 3, frames), (Matched{0, 1, 2, std::nullopt}));
}

TEST(MatchMasks, OneMaskForTwoFramesIsRefused) {
  Frames frames = some_frames();
  frames.frames[1].source = "photo1.png";
  EXPECT_THAT(refusal_of([&] {
                match_masks("m", {"photo1.png", "photo6.png"}, 2, frames);
              }),
              HasSubstr("one for both 000000 and 000001"));
}

TEST(Proportions, OfAPictureThatWasTurnedAreRefused) {
  const Vec2<int64_t> size(108, 192);
  EXPECT_THAT(refusal_of([&] { require_proportions("m", "masks", size, "000003", 1080, 1920); }), "accepted");
  EXPECT_THAT(refusal_of([&] { require_proportions("m", "masks", size, "000003", 960, 540); }),
              HasSubstr("m: masks: found 108×192 for 000003, expected the proportions of 960×540"));
}

}  // namespace
}  // namespace traceflow::prepare
