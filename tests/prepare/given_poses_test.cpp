#include "prepare/given_poses.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/gtc/quaternion.hpp>
#include <limits>

#include "capture/capture.h"
#include "capture/synth/scenes.h"
#include "capture/synth/trace.h"
#include "files/png.h"
#include "prepare/megasam_file.h"
#include "prepare/prepare_case.h"
#include "support/file_bytes.h"

namespace traceflow::prepare {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

// From the true world to the file's.
struct FileWorld {
  double scale = 1;
  Mat3<double> rotation{1};
  Vec3<double> shift{0};

  Vec3<double> operator()(const Vec3<double>& x) const { return scale * (rotation * x) + shift; }
  Vec3<double> undone(const Vec3<double>& x) const { return (x - shift) / scale * rotation; }
};
const FileWorld own_world;
const FileWorld another_world{
    2.5, glm::mat3_cast(glm::normalize(glm::dquat(0.8, 0.3, -0.4, 0.2))), {3, -1, 7}};

void store_camera(const Camera<double>& camera, const FileWorld& world, float* to) {
  const Mat3<double> world_from_camera = world.rotation * glm::transpose(camera.camera_from_world);
  const Vec3<double> position = world(camera.position);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      to[4 * row + column] = static_cast<float>(world_from_camera[column][row]);
    to[4 * row + 3] = static_cast<float>(position[row]);
  }
  to[15] = 1;
}

class GivenPoses : public PrepareTest {
 protected:
  // What MegaSaM would find, without errors, where it scaled the frames to width×height and cut them.
  MegaSamFile truth(int width, int height, int cut_width, int cut_height, const FileWorld& world) const {
    SynthOptions scene;
    scene.frames = frames;
    scene.width = width;
    scene.height = height;
    scene.samples = 1;
    scene.test_every = frames;
    MegaSamFile file;
    file.cameras.reset({frames, 4, 4});
    file.images.reset({frames, cut_height, cut_width, 3});
    file.depths.reset({frames, cut_height, cut_width});
    int64_t i = 0;
    for (const SynthView& view : synth_views(scene)) {
      if (view.is_test) continue;
      const SynthImages images = synth_images(scene, view);
      for (int64_t y = 0; y < cut_height; ++y) {
        for (int64_t x = 0; x < cut_width; ++x) {
          const int64_t pixel = (i * cut_height + y) * cut_width + x;
          file.depths[pixel] = static_cast<float>(world.scale) * images.depth(y, x);
          for (int64_t c = 0; c < 3; ++c)
            file.images[3 * pixel + c] = static_cast<float>(to_8bit(images.colour(y, x, c)));
        }
      }
      store_camera(view.camera, world, file.cameras.row(i++));
      file.intrinsic.reset({3, 3});
      file.intrinsic(0, 0) = static_cast<float>(view.camera.focal_x);
      file.intrinsic(1, 1) = static_cast<float>(view.camera.focal_y);
      // Of the centre of the first pixel they say 0.
      file.intrinsic(0, 2) = static_cast<float>(view.camera.centre_x - 0.5);
      file.intrinsic(1, 2) = static_cast<float>(view.camera.centre_y - 0.5);
      file.intrinsic(2, 2) = 1;
    }
    return file;
  }
  MegaSamFile small() const { return truth(64, 40, 64, 40, own_world); }

  fs::path npz() const { return folder_ / "scene_sgd_cvd_hr.npz"; }
  PrepareOptions with_file() const {
    PrepareOptions o = options();
    o.poses = npz();
    return o;
  }

  // Frames' cameras, by frame.
  void expect_true_cameras(const Capture& made, const FileWorld& world) const {
    ASSERT_EQ(made.train.size() + made.test.size(), static_cast<size_t>(frames));
    for (const auto* split : {&made.train, &made.test}) {
      for (const View& view : *split) {
        const Camera<double>& expected = views_[std::stoul(view.id)].camera;
        const Vec3<double> position =
            world.undone(made.normalisation.in_capture(Vec3<double>(view.camera.position)));
        EXPECT_LT(length(position - expected.position), 1e-4) << view.id;
        const Mat3<double> rotation = Mat3<double>(view.camera.camera_from_world) * world.rotation;
        for (int k = 0; k < 3; ++k)
          EXPECT_LT(length(rotation[k] - expected.camera_from_world[k]), 1e-4) << view.id;
        EXPECT_NEAR(view.camera.focal_x, expected.focal_x, 1e-3);
        EXPECT_NEAR(view.camera.focal_y, expected.focal_y, 1e-3);
        EXPECT_NEAR(view.camera.centre_x, expected.centre_x, 1e-3);
        EXPECT_NEAR(view.camera.centre_y, expected.centre_y, 1e-3);
        EXPECT_NEAR(view.time, static_cast<float>(std::stoi(view.id)) / (frames - 1), 1e-6);
      }
    }
  }
  // The surfaces at all times are hit by rays, not by pixels.
  void expect_true_points(const Capture& made, const FileWorld& world) const {
    const synth::AnimatedScene scene = synth::make_scene(SynthScene::balls);
    std::vector<synth::Stage> stages;
    stages.reserve(views_.size());
    for (const SynthView& view : views_) stages.push_back(scene.at(view.time));
    ASSERT_GT(made.points.dim(0), 1000);
    int64_t good = 0;
    for (int64_t i = 0; i < made.points.dim(0); ++i) {
      const Vec3<double> point =
          world.undone(made.normalisation.in_capture(load3<double>(made.points.row(i))));
      int shown = 0;
      for (size_t k = 0; k < views_.size(); ++k) {
        const Vec3<double> from = views_[k].camera.position, way = point - from;
        const auto hit = synth::nearest_hit(stages[k], {from, normalize(way)});
        if (hit && std::abs(hit->distance / length(way) - 1) < 2e-3) ++shown;
      }
      if (shown >= 3) ++good;
    }
    EXPECT_GT(static_cast<double>(good), 0.99 * static_cast<double>(made.points.dim(0)));
  }

  // White where a frame's pixel or its neighbours show what moves.
  fs::path write_true_masks() const {
    const synth::AnimatedScene scene = synth::make_scene(SynthScene::balls);
    fs::path folder = folder_ / "moving";
    fs::create_directory(folder);
    for (const SynthView& view : views_) {
      const synth::Stage stage = scene.at(view.time);
      const auto moves = [&](double x, double y) {
        const auto hit =
            synth::nearest_hit(stage, {view.camera.position, normalize(view.camera.ray_in_world(x, y))});
        return hit && stage.bodies[static_cast<size_t>(hit->body)].object >= 0;
      };
      const std::string file = fmt::format("{:06}.png", view.frame), hidden = folder / ("." + file);
      write_still(hidden);
      std::ofstream(folder / file) << "a picture";
      std::ofstream colour(hidden + ".ppm", std::ios::binary);
      colour << "P6\n64 40\n255\n";
      for (int pixel = 0; pixel < 64 * 40; ++pixel) {
        const int x = pixel % 64, y = pixel / 64;
        bool is_white = false;
        for (const double right : {-0.5, 0.0, 0.5, 1.0, 1.5}) {
          for (const double down : {-0.5, 0.0, 0.5, 1.0, 1.5}) is_white |= moves(x + right, y + down);
        }
        for (int channel = 0; channel < 3; ++channel) colour.put(is_white ? '\xff' : '\0');
      }
    }
    return folder;
  }

  // What `prepare` says of the small file after a change.
  std::string refused(const std::function<void(MegaSamFile& file)>& change) {
    MegaSamFile file = small();
    change(file);
    file.save(npz());
    return refusal(with_file());
  }
};

// MegaSaM scales 64×40 to 560×350 and cuts this to 560×344.
TEST_F(GivenPoses, CamerasAndPointsAreThoseOfTheFile) {
  truth(560, 350, 560, 344, another_world).save(npz());
  fs::remove(folder_ / "bin/colmap");
  PrepareOptions masked = with_file();
  masked.masks = write_true_masks();
  ASSERT_TRUE(prepare(masked));
  EXPECT_THAT(calls(), Not(testing::Contains(testing::StartsWith("colmap"))));
  ASSERT_EQ(lines_.size(), 6U);
  EXPECT_THAT(lines_[2], HasSubstr("features  none, since --poses gives the cameras"));
  EXPECT_THAT(lines_[3], HasSubstr("matches   none, since --poses gives the cameras"));
  EXPECT_THAT(lines_[4], AllOf(HasSubstr("poses     14 cameras of scene_sgd_cvd_hr.npz, "),
                               HasSubstr(" points (three frames agree on "),
                               HasSubstr("% of its depths), reprojection error 0.0"),
                               HasSubstr(" px, focal length of 60 px for 64×40")));
  EXPECT_THAT(lines_[5], HasSubstr("11 training and 3 test views of 64×40"));
  const Capture made = load_capture(capture(), {});
  EXPECT_TRUE(made.warnings.empty()) << made.warnings.front().text;
  expect_true_cameras(made, another_world);
  expect_true_points(made, another_world);
}

TEST_F(GivenPoses, ImagesAreAsWithColmap) {
  small().save(npz());
  ASSERT_TRUE(prepare(with_file()));
  const fs::path other = folder_ / "other";
  ASSERT_TRUE(prepare(film(), other, options()));
  for (const char* name : {"rgb/1x/000005.png", "rgb/2x/000013.png", "dataset.json", "metadata.json"}) {
    EXPECT_FALSE(bytes_of(other / name).empty()) << name;
    EXPECT_EQ(bytes_of(capture() / name), bytes_of(other / name)) << name;
  }
}

// The film's pictures 1, 3, 5, … are the frames.
TEST_F(GivenPoses, AFileOfAllPicturesOfTheFilmHasThoseOfTheFrames) {
  const MegaSamFile of_frames = small();
  MegaSamFile of_film = of_frames;
  of_film.cameras.reset({2 * frames, 4, 4});
  of_film.images.reset({2 * frames, 40, 64, 3});
  of_film.depths.reset({2 * frames, 40, 64});
  for (int64_t i = 0; i < frames; ++i) {
    const auto copy = [i](const Tensor<float>& from, Tensor<float>& to) {
      std::copy_n(from.row(i), from.row_size(), to.row(2 * i + 1));
    };
    copy(of_frames.cameras, of_film.cameras);
    copy(of_frames.images, of_film.images);
    copy(of_frames.depths, of_film.depths);
  }
  of_film.save(npz());
  ASSERT_TRUE(prepare(with_file()));
  expect_true_cameras(load_capture(capture(), {}), own_world);
}

TEST_F(GivenPoses, WhatStandsIsNotDoneAgain) {
  MegaSamFile file = small();
  file.save(npz());
  ASSERT_TRUE(prepare(with_file()));
  ASSERT_TRUE(prepare(with_file()));
  EXPECT_THAT(lines_, testing::Each(testing::EndsWith("(stands)")));
  // Another file changes the poses only, COLMAP all that is its own.
  for (float& value : file.depths.values()) value *= 1.001F;
  file.save(folder_ / "another.npz");
  PrepareOptions other = with_file();
  other.poses = folder_ / "another.npz";
  ASSERT_TRUE(prepare(other));
  EXPECT_THAT(lines_[3], testing::EndsWith("(stands)"));
  EXPECT_THAT(lines_[4], AllOf(HasSubstr("another.npz"), Not(testing::EndsWith("(stands)"))));
  ASSERT_TRUE(prepare(options()));
  EXPECT_THAT(calls(), ElementsAre("colmap feature_extractor", "colmap exhaustive_matcher", "colmap mapper"));
  ASSERT_TRUE(prepare(other));
  EXPECT_THAT(calls(), IsEmpty());
  EXPECT_THAT(lines_[4], HasSubstr("another.npz"));
}

TEST_F(GivenPoses, NoPointComesFromWhereAMaskIsWhite) {
  small().save(npz());
  PrepareOptions masked = with_file();
  masked.masks = write_masks(32, 20);
  ASSERT_TRUE(prepare(masked));
  const std::string images = bytes_of(work_folder(capture()) / "colmap/models/0/images.txt");
  std::istringstream lines(images);
  int64_t seen = 0;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with('#') || line.find(".png") != std::string::npos) continue;
    std::istringstream features(line);
    for (double x = 0, y = 0, point = 0; features >> x >> y >> point; ++seen) EXPECT_GE(x, 32);
  }
  EXPECT_GT(seen, 300);
}

TEST_F(GivenPoses, MasksAreEstimatedAgainWithTheCameras) {
  small().save(npz());
  PrepareOptions estimate = with_file();
  estimate.masks = "estimate";
  ASSERT_TRUE(prepare(estimate));
  const Capture made = load_capture(capture(), {});
  EXPECT_TRUE(made.masks_are_estimated);
  EXPECT_EQ(read_png_size(capture() / "motion_mask/1x/000004.png.png").width, 64);
}

TEST_F(GivenPoses, NegativeAndInfiniteDepthsAreIgnored) {
  MegaSamFile file = small();
  for (int64_t i = 0; i < file.depths.size(); i += 3) {
    file.depths[i] = i % 2 == 0 ? -1 : std::numeric_limits<float>::infinity();
  }
  file.save(npz());
  // Hardly any four neighbours are left.
  EXPECT_THAT(refusal(with_file()), HasSubstr("depths: found 0 of "));
  file = small();
  for (int64_t i = 0; i < file.depths.size(); i += 40) file.depths[i] = -1;
  file.save(npz());
  EXPECT_TRUE(prepare(with_file()));
}

TEST_F(GivenPoses, AWrongNumberOfCamerasIsNamed) {
  const std::string found = refused([](MegaSamFile& file) {
    file.cameras.resize({13, 4, 4});
    file.images.resize({13, 40, 64, 3});
    file.depths.resize({13, 40, 64});
  });
  EXPECT_THAT(found,
              HasSubstr("scene_sgd_cvd_hr.npz: cam_c2w: found 13 cameras, expected one for each of 14 "
                        "frames, or of the 28 pictures they were taken from; run MegaSaM on the frames"));
  EXPECT_FALSE(fs::exists(work_folder(capture()) / "masks.json"));
}

TEST_F(GivenPoses, PicturesOfOtherProportionsAreRefused) {
  const std::string found = refused([](MegaSamFile& file) {
    file.images.reset({frames, 48, 64, 3});
    file.depths.reset({frames, 48, 64});
  });
  EXPECT_THAT(found, HasSubstr("images: found 64×48, expected the proportions of 64×40"));
}

TEST_F(GivenPoses, PicturesOfAnotherFilmAreRefused) {
  const std::string found = refused(
      [](MegaSamFile& file) { std::reverse(file.images.data(), file.images.data() + file.images.size()); });
  EXPECT_THAT(found, AllOf(HasSubstr("images[0]: found a picture unlike frame 000000 (correlation "),
                           HasSubstr("expected the same picture (at least 0.8)")));
}

TEST_F(GivenPoses, WrongShapesAreRefused) {
  EXPECT_THAT(refused([](MegaSamFile& file) {
                file.cameras.resize({14, 3, 4});
              }),
              HasSubstr("cam_c2w: found 14x3x4, expected T×4×4; give SCENE_sgd_cvd_hr.npz"));
  EXPECT_THAT(refused([](MegaSamFile& file) {
                file.images.resize({13, 40, 64, 3});
              }),
              HasSubstr("images: found 13x40x64x3, expected 14×H×W×3, one for each camera"));
  EXPECT_THAT(refused([](MegaSamFile& file) {
                file.depths.resize({14, 40, 32});
              }),
              HasSubstr("depths: found 14x40x32, expected 14×40×64, as images has"));
  EXPECT_THAT(refused([](MegaSamFile& file) {
                file.intrinsic.resize({1, 9});
              }),
              HasSubstr("intrinsic: found 1x9, expected 3×3"));
}

TEST_F(GivenPoses, MatricesThatAreNoPosesAreRefused) {
  const auto with = [&](int64_t place, float value) {
    return refused([&](MegaSamFile& file) { file.cameras[5 * 16 + place] = value; });
  };
  EXPECT_THAT(with(3, std::numeric_limits<float>::quiet_NaN()),
              HasSubstr("cam_c2w[5]: found nan, expected a rotation and a position"));
  EXPECT_THAT(with(0, 2), HasSubstr("cam_c2w[5]: found a matrix that scales or shears"));
  EXPECT_THAT(with(15, 0), HasSubstr("cam_c2w[5]: found the last row [0 0 0 0]"));
  EXPECT_THAT(refused([](MegaSamFile& file) {
                for (const int64_t row : {0, 4, 8}) file.cameras[5 * 16 + row] *= -1;
              }),
              HasSubstr("cam_c2w[5]: found a matrix that mirrors"));
}

TEST_F(GivenPoses, IntrinsicsThatAreNoneAreRefused) {
  const auto with = [&](int64_t row, int64_t column, float value) {
    return refused([&](MegaSamFile& file) { file.intrinsic(row, column) = value; });
  };
  EXPECT_THAT(
      with(0, 0, 0),
      HasSubstr("intrinsic: found a focal length of 0, expected 6.4 to 6400 pixels for images of 64×40"));
  EXPECT_THAT(with(1, 1, -60), HasSubstr("intrinsic: found a focal length of -60"));
  EXPECT_THAT(with(1, 1, std::numeric_limits<float>::infinity()), HasSubstr("intrinsic: found inf"));
  EXPECT_THAT(with(0, 2, 70),
              HasSubstr("intrinsic: found a principal point of (70, 19.5), expected one inside"));
  EXPECT_THAT(with(0, 1, 5), HasSubstr("intrinsic: found other entries than fx, fy, cx and cy"));
}

// As depths of another unit than the positions.
TEST_F(GivenPoses, DepthsThatDoNotAgreeAreRefused) {
  const std::string found = refused([](MegaSamFile& file) {
    for (float& value : file.depths.values()) value *= 0.2F;
  });
  EXPECT_THAT(found, AllOf(HasSubstr("depths: found "),
                           HasSubstr("sampled pixels where three frames agree, expected at least 100 and 2%"),
                           HasSubstr("one unit")));
}

TEST_F(GivenPoses, CamerasOfOtherConventionsAreRefused) {
  const std::string turned = refused([](MegaSamFile& file) {
    for (int64_t i = 0; i < frames; ++i) {
      for (const int64_t entry : {1, 2, 5, 6, 9, 10}) file.cameras[16 * i + entry] *= -1;
    }
  });
  EXPECT_THAT(turned,
              AllOf(HasSubstr("cam_c2w: found camera axes x right, y up, z backward, with which three "
                              "frames agree on "),
                    HasSubstr("expected matrices from camera to world, camera axes x right, y down")));
  const std::string inverse = refused([](MegaSamFile& file) {
    for (int64_t i = 0; i < frames; ++i) {
      float* const m = file.cameras.row(i);
      Mat3<double> turn;
      for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column) turn[column][row] = m[4 * row + column];
      }
      const Vec3<double> back = -(Vec3<double>(m[3], m[7], m[11]) * turn);
      for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column)
          m[4 * row + column] = static_cast<float>(turn[row][column]);
        m[4 * row + 3] = static_cast<float>(back[row]);
      }
    }
  });
  EXPECT_THAT(inverse, HasSubstr("cam_c2w: found matrices from world to camera"));
}

TEST_F(GivenPoses, WhatIsNoFileIsRefusedBeforeAnyWork) {
  PrepareOptions wrong = with_file();
  EXPECT_THAT(refusal(wrong),
              AllOf(HasSubstr("option: poses: found "), HasSubstr(".npz, which does not exist")));
  fs::create_directory(npz());
  EXPECT_THAT(refusal(wrong), HasSubstr(".npz, which is no file"));
  fs::remove(npz());
  write_bytes(npz(), "no archive");
  EXPECT_THAT(refusal(wrong), HasSubstr("scene_sgd_cvd_hr.npz: "));
  wrong.poses = "megasam";
  EXPECT_THAT(refusal(wrong), HasSubstr("poses: found megasam, expected colmap, or an .npz file of MegaSaM"));
  EXPECT_THAT(calls(), IsEmpty());
}

TEST_F(GivenPoses, ASecondCameraHasNoPlaceInTheFile) {
  small().save(npz());
  PrepareOptions two = with_file();
  two.test_video = film();
  EXPECT_THAT(refusal(two), AllOf(HasSubstr("test_video"), HasSubstr("no second camera with --poses FILE")));
}

TEST_F(GivenPoses, AFileInItsOwnFoldersIsNotTaken) {
  const fs::path frames_folder = work_folder(capture()) / "frames";
  fs::create_directories(frames_folder);
  PrepareOptions wrong = with_file();
  wrong.poses = frames_folder / "scene.npz";
  small().save(wrong.poses);
  EXPECT_THAT(refusal(wrong), HasSubstr("found a folder that this preparation writes itself"));
  EXPECT_TRUE(fs::exists(wrong.poses));
}

// The scale of a frame by MegaSaM's rule: an area of 512×384, whole pixels, cut to multiples of 8.
TEST_F(GivenPoses, CutEdgesAreNotScaled) {
  const auto scale = [&](int64_t width, int64_t height, double frame_width, double frame_height) {
    MegaSamFile file;
    file.cameras.reset({1, 4, 4});
    file.images.reset({1, height, width, 3});
    file.depths.reset({1, height, width});
    file.intrinsic.reset({3, 3});
    file.intrinsic(0, 0) = file.intrinsic(1, 1) = 500;
    file.intrinsic(0, 2) = file.intrinsic(1, 2) = 100;
    file.intrinsic(2, 2) = 1;
    file.save(npz());
    return PoseFile(npz()).frame_pixels(frame_width, frame_height);
  };
  const auto near = [](double x, double y) {
    return testing::Truly(
        [=](const Vec2<double>& v) { return std::abs(v.x - x) < 1e-12 && std::abs(v.y - y) < 1e-12; });
  };
  EXPECT_THAT(scale(584, 328, 960, 540), near(960.0 / 591, 540.0 / 332));
  EXPECT_THAT(scale(328, 584, 540, 960), near(540.0 / 332, 960.0 / 591));
  EXPECT_THAT(scale(512, 384, 960, 720), near(960.0 / 512, 720.0 / 384));
  EXPECT_THAT(scale(512, 384, 640, 480), near(640.0 / 512, 480.0 / 384));
  EXPECT_THAT(scale(680, 280, 960, 400), near(960.0 / 686, 400.0 / 286));
  // Not by this rule: the whole frame.
  EXPECT_THAT(scale(480, 270, 960, 540), near(2, 2));
  EXPECT_THAT(scale(480, 272, 960, 540), near(2, 540.0 / 272));
}

}  // namespace
}  // namespace traceflow::prepare
