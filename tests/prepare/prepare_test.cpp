#include "prepare/prepare.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <glm/gtc/quaternion.hpp>
#include <iomanip>
#include <thread>

#include "base/folder_lock.h"
#include "capture/capture.h"
#include "files/json_document.h"
#include "files/png.h"
#include "prepare/prepare_case.h"
#include "support/file_bytes.h"

namespace traceflow::prepare {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

TEST_F(PrepareTest, MakesACaptureWithTheKnownCameras) {
  ASSERT_TRUE(prepare(options()));
  EXPECT_THAT(calls(), ElementsAre("ffmpeg pgm", "ffmpeg ppm", "colmap feature_extractor",
                                   "colmap exhaustive_matcher", "colmap mapper"));
  ASSERT_EQ(lines_.size(), 6U);
  EXPECT_THAT(lines_[0], HasSubstr("14 of 28 pictures, the sharpest of each interval, 64×40, over 6.50 s"));
  EXPECT_THAT(lines_[4],
              HasSubstr("14 of 14 frames registered, 300 points, reprojection error 0.50 px, lens PINHOLE"));
  const Capture made = load_capture(capture(), {});
  EXPECT_TRUE(made.warnings.empty()) << made.warnings.front().text;
  ASSERT_EQ(made.train.size(), 11U);
  ASSERT_EQ(made.test.size(), 3U);
  for (const View& view : made.train) {
    const SynthView& truth = views_[std::stoul(view.id)];
    EXPECT_LT(
        length(made.normalisation.in_capture(Vec3<double>(view.camera.position)) - truth.camera.position),
        1e-5);
    EXPECT_NEAR(view.camera.focal_x, truth.camera.focal_x, 1e-3);
    EXPECT_NEAR(view.time, static_cast<float>(truth.frame) / (frames - 1), 1e-6);
  }
  EXPECT_THAT(told_, testing::IsSupersetOf({"frames 0/0", "frames 28/0", "frames 14/14", "features 0/0",
                                            "matches 0/0", "poses 0/0", "capture 0/0", "capture 14/14"}));
  // The sharp ones of the film were taken.
  const Tensor<uint8_t> taken = read_png(capture() / "rgb/1x/000002.png");
  EXPECT_NE(*std::max_element(taken.data(), taken.data() + taken.size()), 90);
}

TEST_F(PrepareTest, AFoldersPicturesHaveTheirPlacesForTimes) {
  ASSERT_TRUE(prepare(write_pictures(), capture(), options()));
  EXPECT_THAT(lines_[0], HasSubstr("14 of 28 pictures, the sharpest of each interval, 64×40 ("));
  const Capture made = load_capture(capture(), {});
  EXPECT_TRUE(made.warnings.empty()) << made.warnings.front().text;
  ASSERT_EQ(made.train.size(), 11U);
  ASSERT_EQ(made.test.size(), 3U);
  // The sharp ones are the pictures 0, 3, 4, 7, 8, … 27.
  for (const auto* split : {&made.train, &made.test}) {
    for (const View& view : *split) {
      const int i = std::stoi(view.id);
      EXPECT_NEAR(view.time, (2 * i + i % 2) / 27.0, 1e-6) << view.id;
      EXPECT_NE(read_png(capture() / "rgb/1x" / (view.id + ".png"))[0], 90) << view.id;
    }
  }
  const JsonFile list(work_folder(capture()) / "frames.list.json");
  std::vector<std::string> sources;
  for (const JsonField& frame : list["frames"].elements()) sources.push_back(frame["source"].text());
  ASSERT_EQ(sources.size(), 14U);
  EXPECT_EQ(sources[0], "IMG_8.png");
  EXPECT_EQ(sources[1], "IMG_11.png");
  EXPECT_EQ(sources[13], "IMG_35.png");
}

TEST_F(PrepareTest, WhatStandsIsNotDoneAgain) {
  ASSERT_TRUE(prepare(options()));
  ASSERT_TRUE(prepare(options()));
  EXPECT_THAT(calls(), IsEmpty());
  EXPECT_THAT(lines_, testing::Each(testing::EndsWith("(stands)")));
  PrepareOptions changed = options();
  changed.matcher = Matcher::sequential;
  ASSERT_TRUE(prepare(changed));
  EXPECT_THAT(calls(), ElementsAre("colmap sequential_matcher", "colmap mapper"));
  changed.test_every = 5;
  ASSERT_TRUE(prepare(changed));
  EXPECT_THAT(calls(), IsEmpty());
  EXPECT_EQ(load_capture(capture(), {}).test.size(), 3U);
  fs::remove_all(capture());
  ASSERT_TRUE(prepare(changed));
  EXPECT_TRUE(fs::exists(capture() / "dataset.json"));
}

TEST_F(PrepareTest, EstimatesMasksAndKeepsFeaturesOffThem) {
  PrepareOptions estimate = options();
  estimate.masks = "estimate";
  ASSERT_TRUE(prepare(estimate));
  EXPECT_TRUE(load_capture(capture(), {}).has_masks);
  const std::string text = bytes_of(folder_ / "calls");
  const fs::path masks = work_folder(capture()) / "colmap/masks";
  EXPECT_THAT(text, HasSubstr("--ImageReader.mask_path " + masks.string()));
  EXPECT_EQ(read_png_size(masks / "000000.png.png").width, 64);
}

TEST_F(PrepareTest, StopsAfterTheStepThatIsAsked) {
  PrepareOptions some = options();
  some.until = Step::frames;
  ASSERT_TRUE(prepare(some));
  EXPECT_THAT(calls(), ElementsAre("ffmpeg pgm", "ffmpeg ppm"));
  EXPECT_FALSE(fs::exists(capture()));
  EXPECT_TRUE(fs::exists(work_folder(capture()) / "frames/000013.png"));
  ASSERT_TRUE(prepare(options()));
  EXPECT_THAT(calls(), ElementsAre("colmap feature_extractor", "colmap exhaustive_matcher", "colmap mapper"));
}

TEST_F(PrepareTest, PosesThatFailSayHowManyAndWhatToTry) {
  set_variable("FAIL", "mapper");
  EXPECT_THAT(refusal(options()),
              testing::AllOf(HasSubstr("0 of 14 frames registered"), HasSubstr("try more frames"),
                             HasSubstr("--masks estimate"), HasSubstr("--camera-model opencv")));
  set_variable("FAIL", "");
  std::ofstream(folder_ / "model/images.txt", std::ios::trunc) << "1 1 0 0 0 0 0 0 1 000000.png\n\n";
  EXPECT_THAT(refusal(options()), HasSubstr("1 of 14 frames registered"));
  EXPECT_FALSE(fs::exists(capture()));
}

TEST_F(PrepareTest, AProgramsFailureIsOneLineWithItsOwnWords) {
  set_variable("FAIL", "features");
  EXPECT_THAT(refusal(options()),
              testing::AllOf(HasSubstr("colmap feature_extractor"), HasSubstr("Check failed: no memory"),
                             HasSubstr("features_0.log")));
  set_variable("FAIL", "");
  ASSERT_TRUE(prepare(options()));
  EXPECT_THAT(calls(), ElementsAre("colmap feature_extractor", "colmap exhaustive_matcher", "colmap mapper"));
  fs::remove(film() + ".pgm");
  std::ofstream(film()) << "another film";
  EXPECT_THAT(refusal(options()), testing::AllOf(HasSubstr("film.mp4"), HasSubstr("Invalid data found")));
}

// It is not for want of anything to register.
TEST_F(PrepareTest, AMapperThatFailsAtWritingItsModelIsAFailure) {
  set_variable("FAIL", "disk");
  EXPECT_THAT(refusal(options()), HasSubstr("colmap mapper: found a failure: No space left on device"));
}

TEST_F(PrepareTest, AStopEndsTheProgramAndTheNextCallGoesOn) {
  set_variable("FAIL", "slow");
  std::thread other([this] {
    while (calls().empty() || calls().back() != "colmap mapper") std::this_thread::yield();
    stop_ = true;
  });
  const bool ended = prepare(options());
  other.join();
  EXPECT_FALSE(ended);
  EXPECT_FALSE(fs::exists(capture()));
  set_variable("FAIL", "");
  stop_ = false;
  ASSERT_TRUE(prepare(options()));
  EXPECT_THAT(calls(), ElementsAre("colmap mapper"));
}

TEST_F(PrepareTest, AStopEndsAnFfmpegThatSaysNothing) {
  set_variable("FAIL", "silent");
  std::thread other([this] {
    while (calls().empty()) std::this_thread::yield();
    stop_ = true;
  });
  const bool ended = prepare(options());
  other.join();
  EXPECT_FALSE(ended);
}

TEST_F(PrepareTest, ASecondOneIsRefusedWhileTheFirstWorks) {
  const fs::path work = work_folder(capture());
  fs::create_directory(work);
  {
    const FolderLock first(work / "lock", work, "preparing");
    EXPECT_THAT(refusal(options()),
                testing::AllOf(HasSubstr("capture.prepare: found process "), HasSubstr(" preparing in it")));
    EXPECT_THAT(calls(), IsEmpty());
  }
  EXPECT_TRUE(prepare(options()));
  EXPECT_FALSE(fs::exists(work / "lock"));
}

TEST_F(PrepareTest, SuppliedMasksKeepFeaturesOffAndComeIntoTheCapture) {
  PrepareOptions supplied = options();
  supplied.masks = write_masks(32, 20);
  ASSERT_TRUE(prepare(supplied));
  EXPECT_THAT(lines_[1], HasSubstr("14 of 14 supplied, covering 50.0% of the pixels"));
  // COLMAP takes features where its mask is not black.
  const Tensor<uint8_t> features = read_png(work_folder(capture()) / "colmap/masks/000005.png.png");
  EXPECT_EQ(features(20, 10, 0), 0);
  EXPECT_EQ(features(20, 50, 0), 255);
  const Tensor<uint8_t> moving = read_png(capture() / "mask/1x/000005.png.png");
  EXPECT_EQ(moving(20, 10, 0), 255);
  EXPECT_EQ(moving(20, 50, 0), 0);
}

TEST_F(PrepareTest, SuppliedMasksThatWereTurnedAreRefused) {
  PrepareOptions supplied = options();
  supplied.masks = write_masks(20, 32);
  EXPECT_THAT(refusal(supplied),
              HasSubstr("masks: found 20×32 for 000000, expected the proportions of 64×40"));
}

TEST_F(PrepareTest, WhatLiesInItsOwnFoldersIsNotTakenForInput) {
  PrepareOptions first = options();
  first.masks = write_masks(64, 40);
  first.until = Step::masks;
  ASSERT_TRUE(prepare(first));
  PrepareOptions second = options();
  second.masks = work_folder(capture()) / "masks";
  EXPECT_THAT(refusal(second), HasSubstr("found a folder that this preparation writes itself"));
  EXPECT_TRUE(fs::exists(work_folder(capture()) / "masks/000000.png"));
  const fs::path frames = work_folder(capture()) / "frames";
  EXPECT_THAT(refusal_of([&] { prepare(frames, capture(), options()); }),
              HasSubstr("capture.prepare/frames"));
  EXPECT_TRUE(fs::exists(frames / "000000.png"));
}

TEST_F(PrepareTest, WhatLiesInTheCaptureThatItReplacesIsNotTakenForInput) {
  PrepareOptions supplied = options();
  supplied.masks = write_masks(64, 40);
  ASSERT_TRUE(prepare(supplied));
  fs::create_directory_symlink(capture(), folder_ / "link");
  for (const fs::path& place : {capture(), folder_ / "link"}) {
    supplied.masks = place / "mask/1x";
    EXPECT_THAT(refusal(supplied),
                HasSubstr("mask/1x: found a part of the capture that this preparation replaces"));
    EXPECT_THAT(refusal_of([&] { prepare(place / "rgb/1x", capture(), options()); }),
                HasSubstr("rgb/1x: found a part of the capture that this preparation replaces"));
  }
  EXPECT_TRUE(fs::exists(capture() / "mask/1x/000000.png.png"));
  // Where the earlier capture goes while the new one takes its place.
  PrepareOptions two = options();
  two.test_video = work_folder(capture()) / "replaced/second.mp4";
  fs::create_directory(work_folder(capture()) / "replaced");
  write_bytes(two.test_video, "a film");
  EXPECT_THAT(refusal(two), HasSubstr("found a folder that this preparation writes itself"));
  EXPECT_TRUE(fs::exists(two.test_video));
}

// ffmpeg would look for pictures of other names.
TEST_F(PrepareTest, APicturesPathIsNoPattern) {
  const std::string odd = folder_ / "film%d.mp4";
  for (const char* ending : {"", ".ppm", ".pgm", ".times"}) fs::copy(film() + ending, odd + ending);
  PrepareOptions supplied = options();
  supplied.masks = write_masks(64, 40, "50%d");
  ASSERT_TRUE(prepare(odd, capture(), supplied));
  std::string called = bytes_of(folder_ / "calls");
  EXPECT_THAT(called, HasSubstr("-loglevel info -i file:" + odd + " "));
  EXPECT_THAT(called, HasSubstr(" -f image2 -pattern_type none -i file:" + supplied.masks + "/000003.png "));
  supplied.masks = write_masks(64, 40);
  ASSERT_TRUE(prepare(odd, capture(), supplied));
  called = bytes_of(folder_ / "calls");
  EXPECT_THAT(called, HasSubstr("-loglevel info -i file:" + supplied.masks + "/000003.png "));
}

// Which may be the first video stream; V is none of these.
TEST_F(PrepareTest, AFilmsCoverIsNotTakenForTheFilm) {
  PrepareOptions some = options();
  some.until = Step::frames;
  ASSERT_TRUE(prepare(some));
  EXPECT_THAT(bytes_of(folder_ / "calls"), HasSubstr(" -map 0:V:0 "));
}

TEST_F(PrepareTest, TheSecondCamerasPicturesTestAndNoneOfThemTrains) {
  PrepareOptions two = options();
  two.test_video = folder_ / "second.mp4";
  SynthOptions same;
  same.frames = frames;
  same.width = 64;
  same.height = 40;
  same.samples = 1;
  same.test_every = frames;
  write_film(same, two.test_video);
  two.test_offset = 1;  // its picture of frame 2 was taken when the first camera took frame 4
  std::ofstream images(folder_ / "model/images.txt"), cameras(folder_ / "model/cameras.txt", std::ios::app);
  images << std::setprecision(17);
  cameras << "2 PINHOLE 64 40 70 70 32 20\n";
  int id = 0;
  for (const SynthView& view : views_) {
    const glm::dquat q = glm::quat_cast(view.camera.camera_from_world);
    const Vec3<double> t = -(view.camera.camera_from_world * view.camera.position);
    for (const int camera : {1, 2}) {
      images << ++id << " " << q.w << " " << q.x << " " << q.y << " " << q.z << " " << t.x << " " << t.y
             << " " << t.z + camera << " " << camera << " "
             << fmt::format("{:06}_{}.png", view.frame, camera == 1 ? "left" : "right") << "\n\n";
    }
  }
  images.close();
  cameras.close();
  ASSERT_TRUE(prepare(two));
  EXPECT_THAT(calls(),
              ElementsAre("ffmpeg pgm", "ffmpeg pgm", "ffmpeg ppm", "ffmpeg ppm", "colmap feature_extractor",
                          "colmap feature_extractor", "colmap exhaustive_matcher", "colmap mapper"));
  EXPECT_THAT(lines_[0], HasSubstr("14 of 28 pictures"));
  const Capture made = load_capture(capture(), {});
  ASSERT_EQ(made.train.size(), 14U);
  for (const View& view : made.train) EXPECT_THAT(view.id, testing::EndsWith("_left"));
  std::vector<std::string> tests;
  for (const View& view : made.test) {
    tests.push_back(view.id);
    EXPECT_NEAR(view.camera.focal_x, 70, 1e-4);
    EXPECT_NEAR(view.time, std::stof(view.id) / (frames - 1), 1e-6);
  }
  EXPECT_THAT(tests, ElementsAre("000002_right", "000006_right", "000010_right"));
  // The film's sharp picture of frame 4 is the second in its row of pairs.
  const JsonFile list(work_folder(capture()) / "frames.list.json");
  std::vector<int64_t> indices;
  for (const JsonField& frame : list["frames"].elements()) {
    if (frame["camera"].whole(0, 1) == 1) indices.push_back(frame["index"].whole(0, 100));
  }
  EXPECT_THAT(indices, ElementsAre(1, 9, 17));
}

TEST_F(PrepareTest, AFolderIsNoSecondCamera) {
  PrepareOptions two = options();
  two.test_video = write_masks(64, 40);
  EXPECT_THAT(refusal(two), HasSubstr("found pictures without times, expected a film for --test-video"));
}

TEST_F(PrepareTest, ALowerShareGoesOnWithTheModelThatWasFound) {
  const fs::path list = folder_ / "model/images.txt";
  const std::string all = bytes_of(list);
  size_t end = 0;
  for (int line = 0; line < 2 * 11; ++line) end = all.find('\n', end) + 1;
  write_bytes(list, all.substr(0, end));
  PrepareOptions strict = options();
  strict.least_registered = 0.9;
  EXPECT_THAT(refusal(strict), testing::AllOf(HasSubstr("11 of 14 frames registered"), HasSubstr("90%")));
  EXPECT_FALSE(fs::exists(capture()));
  ASSERT_TRUE(prepare(options()));
  EXPECT_THAT(calls(), IsEmpty());
  EXPECT_EQ(load_capture(capture(), {}).train.size(), 8U);
}

TEST_F(PrepareTest, ANameThatIsNotUtf8IsANameLikeOthers) {
  const std::string odd = folder_ / "caf\xe9.mp4";
  for (const char* ending : {"", ".ppm", ".pgm", ".times"}) fs::copy(film() + ending, odd + ending);
  ASSERT_TRUE(prepare(odd, capture(), options()));
  ASSERT_TRUE(prepare(fs::path(odd).parent_path() / "." / fs::path(odd).filename(), capture(), options()));
  EXPECT_THAT(calls(), IsEmpty());
}

TEST_F(PrepareTest, ALinkToTheCapturesFolderStaysOne) {
  fs::create_directory(folder_ / "disk");
  fs::create_directory_symlink(folder_ / "disk", folder_ / "link");
  ASSERT_TRUE(prepare(film(), folder_ / "link", options()));
  EXPECT_TRUE(fs::is_symlink(folder_ / "link"));
  EXPECT_TRUE(fs::exists(folder_ / "disk/dataset.json"));
  EXPECT_TRUE(fs::exists(folder_ / "disk.prepare/frames"));
}

TEST_F(PrepareTest, TheFolderThatOneIsInIsNotReplaced) {
  const fs::path before = fs::current_path();
  fs::create_directory(capture());
  fs::current_path(capture());
  const std::string found = refusal_of([&] { prepare(film(), ".", options()); });
  fs::current_path(before);
  EXPECT_THAT(found, HasSubstr("output folder: found the folder that you are in"));
  EXPECT_THAT(calls(), IsEmpty());
}

TEST_F(PrepareTest, AbsentProgramsAreNamed) {
  set_variable("PATH", "/nowhere");
  EXPECT_THAT(refusal(options()), testing::AllOf(HasSubstr("ffmpeg: found no such program"),
                                                 HasSubstr("scripts/setup --prepare")));
  set_variable("PATH", (folder_ / "bin"));
  fs::remove(folder_ / "bin/colmap");
  EXPECT_THAT(refusal(options()), HasSubstr("colmap: found no such program"));
}

TEST_F(PrepareTest, ACaptureThatSomethingWasAddedToIsNotReplaced) {
  ASSERT_TRUE(prepare(options()));
  fs::create_directory(capture() / "normal");
  EXPECT_TRUE(prepare(options()));
  PrepareOptions changed = options();
  changed.matcher = Matcher::sequential;
  EXPECT_THAT(refusal(changed), HasSubstr("found normal, which prepare did not write"));
  EXPECT_TRUE(prepare(options()));
  EXPECT_THAT(calls(), IsEmpty());
}

TEST_F(PrepareTest, WhatIsInTheWayIsLeftAlone) {
  fs::create_directories(capture() / "holiday");
  EXPECT_THAT(refusal(options()), HasSubstr("output folder: found other files in it"));
  EXPECT_THAT(refusal_of([&] { prepare(capture() / "holiday", capture(), options()); }),
              HasSubstr("output folder: found other files in it"));
  EXPECT_FALSE(fs::exists(work_folder(capture())));
  EXPECT_TRUE(fs::exists(capture() / "holiday"));
}

TEST_F(PrepareTest, AnEmptyFolderStandsUntilTheCaptureTakesItsPlace) {
  fs::create_directory(capture());
  set_variable("FAIL", "mapper");
  EXPECT_THAT(refusal(options()), HasSubstr("0 of 14 frames registered"));
  EXPECT_TRUE(fs::is_directory(capture()) && fs::is_empty(capture()));
  EXPECT_FALSE(fs::exists(work_folder(capture()) / "trial"));
  set_variable("FAIL", "");
  ASSERT_TRUE(prepare(options()));
  EXPECT_TRUE(fs::exists(capture() / "dataset.json"));
}

}  // namespace
}  // namespace traceflow::prepare
