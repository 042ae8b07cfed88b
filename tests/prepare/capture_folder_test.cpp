#include "prepare/capture_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "base/error.h"
#include "base/random.h"
#include "capture/capture.h"
#include "files/png.h"
#include "math/rotation.h"
#include "prepare/masks.h"
#include "prepare/scene_bounds.h"
#include "support/refusal.h"
#include "support/temp_folder.h"

namespace traceflow::prepare {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr int64_t width = 48, height = 32;

// A model and frames as the steps before leave them.
struct Parts {
  TempFolder folder;
  CaptureParts parts;

  explicit Parts(const Lens& lens, int64_t frames = 12, int64_t without_pose = 1) {
    parts.pictures = folder / "frames";
    parts.masks = folder / "masks";
    fs::create_directories(parts.pictures);
    fs::create_directories(parts.masks);
    parts.frames.source_frames = {frames * 3};
    parts.model.cameras.push_back({1, "OPENCV", lens});
    Random random(11);
    for (int64_t i = 0; i < frames; ++i) {
      const std::string id = "0000" + std::to_string(10 + i);
      parts.frames.frames.push_back({id, 0, "", 3 * i, 0.2 * static_cast<double>(i), 1, width, height});
      Tensor<uint8_t> picture({height, width, 3});
      for (int64_t k = 0; k < picture.size(); ++k) picture[k] = static_cast<uint8_t>((k % 7) * 20 + i);
      write_png(parts.pictures / (id + ".png"), picture);
      Tensor<uint8_t> mask({height, width});
      for (int64_t y = 10; y < 20; ++y) std::fill(&mask(y, 12), &mask(y, 30), uint8_t{1});
      write_mask(parts.masks / (id + ".png"), mask);
      if (i < without_pose) continue;
      const Vec4<double> turn(1, 0.02 * static_cast<double>(i), -0.01, 0.03);
      parts.model.images.push_back(
          {i, 1, id + ".png", rotation_from_quaternion(turn), {0.1 * static_cast<double>(i), 0.3, -1}, 100});
    }
    for (int i = 0; i < 500; ++i) {
      parts.model.points.push_back(
          {{random.uniform(-1, 2), random.uniform(-1, 1), random.uniform(2, 4)}, Vec3<uint8_t>(9), 0.5, 5});
    }
  }
};

Lens plain_lens() { return {width, height, Vec2<double>(50, 51), Vec2<double>(24.5, 15.5)}; }

PrepareOptions with_masks() {
  PrepareOptions options;
  options.masks = "given";
  options.test_every = 4;
  return options;
}

TEST(WriteCapture, IsReadBackAsItWasPosed) {
  const Parts p(plain_lens());
  const std::atomic<bool> stop = false;
  const std::string found = write_capture(with_masks(), p.parts, p.folder / "out", stop);
  EXPECT_THAT(found, HasSubstr("8 training and 3 test views of 48×32, 500 points"));

  const Capture capture = load_capture(p.folder / "out", {});
  EXPECT_TRUE(capture.warnings.empty()) << capture.warnings.front().text;
  ASSERT_EQ(capture.train.size(), 8U);
  ASSERT_EQ(capture.test.size(), 3U);
  EXPECT_TRUE(capture.has_masks && !capture.masks_are_estimated);
  EXPECT_EQ(capture.test[0].id, "000013");  // the third that has a pose
  const View& view = capture.train[1];
  EXPECT_EQ(view.id, "000012");
  EXPECT_FLOAT_EQ(view.time, 0.1F);  // from the first that has a pose, at 1, to the last at 11
  const ColmapImage& image = p.parts.model.images[1];
  EXPECT_NEAR(view.camera.focal_x, 50, 1e-4);
  EXPECT_NEAR(view.camera.focal_y, 51, 1e-4);
  EXPECT_NEAR(view.camera.centre_x, 24.5, 1e-4);
  const Vec3<double> position = capture.normalisation.in_capture(Vec3<double>(view.camera.position));
  EXPECT_LT(length(position - image.position), 1e-5);
  for (int k = 0; k < 9; ++k)
    EXPECT_NEAR(view.camera.camera_from_world[k / 3][k % 3], image.camera_from_world[k / 3][k % 3], 1e-6);
  const auto images = load_images(capture, view);
  EXPECT_NEAR(images->colour(5, 6, 1), static_cast<float>(((5 * width + 6) * 3 + 1) % 7 * 20 + 2) / 255,
              1e-5);
  EXPECT_EQ(images->mask(12, 13), 1);
  EXPECT_EQ(images->mask(9, 13), 0);
  EXPECT_EQ(capture.points.dim(0), 500);
  EXPECT_EQ(read_png_size(p.folder / "out/rgb/4x/000012.png").width, width / 4);
}

TEST(WriteCapture, StraightensPicturesAndMasks) {
  Lens lens = plain_lens();
  lens.radial = {-0.2, 0.01, 0};
  const Parts p(lens);
  const std::atomic<bool> stop = false;
  EXPECT_THAT(write_capture(with_masks(), p.parts, p.folder / "out", stop), HasSubstr("straightened"));
  const double zoom = pinhole_zoom(lens, "");
  const Capture capture = load_capture(p.folder / "out", {});
  EXPECT_NEAR(capture.train[0].camera.focal_x, 50 * zoom, 1e-4);
  // A place that the straightened mask shows as moving was so in the stored one.
  const auto images = load_images(capture, capture.train[0]);
  for (int64_t y = 0; y < height; ++y) {
    for (int64_t x = 0; x < width; ++x) {
      const Vec2<double> pixel(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5);
      const Vec2<double> at = lens.pixel_from_ideal((pixel - lens.centre) / (zoom * lens.focal));
      if (at.x > 13 && at.x < 29 && at.y > 11 && at.y < 19) {
        ASSERT_EQ(images->mask(y, x), 1);
      } else if (at.x < 11 || at.x > 31 || at.y < 9 || at.y > 21) {
        ASSERT_EQ(images->mask(y, x), 0);
      }
    }
  }
}

// A ramp along either side, whose sides are no multiples of 2: what a pixel shows tells where it is.
TEST(WriteCapture, SmallPicturesOfOddSidesAreWhatTheirCamerasSee) {
  constexpr int64_t wide = 51, high = 35;
  const Lens lens{wide, high, Vec2<double>(50, 51), Vec2<double>(25.7, 17.2)};
  const Parts p(lens);
  Tensor<uint8_t> ramps({high, wide, 3});
  for (int64_t y = 0; y < high; ++y) {
    for (int64_t x = 0; x < wide; ++x) {
      ramps(y, x, 0) = static_cast<uint8_t>(5 * x);
      ramps(y, x, 1) = static_cast<uint8_t>(7 * y);
    }
  }
  for (const Frame& frame : p.parts.frames.frames) write_png(p.parts.pictures / (frame.id + ".png"), ramps);
  const std::atomic<bool> stop = false;
  PrepareOptions options = with_masks();
  options.masks = "none";
  write_capture(options, p.parts, p.folder / "out", stop);

  const Camera<float> full = load_capture(p.folder / "out", {}).train[0].camera;
  for (const int downscale : {2, 4}) {
    CaptureOptions smaller;
    smaller.downscale = downscale;
    const Capture capture = load_capture(p.folder / "out", smaller);
    const Camera<float>& small = capture.train[0].camera;
    ASSERT_EQ(small.width, wide / downscale);
    ASSERT_EQ(small.height, high / downscale);
    const auto images = load_images(capture, capture.train[0]);
    for (int64_t y = 0; y < small.height; ++y) {
      for (int64_t x = 0; x < small.width; ++x) {
        const float u = static_cast<float>(x) + 0.5F, v = static_cast<float>(y) + 0.5F;
        const Vec2<float> at = full.project(small.ray_in_camera(u, v));
        // Half a level for 8 bits, and less than that for pixels that are cut.
        EXPECT_NEAR(255 * images->colour(y, x, 0), 5 * (at.x - 0.5F), 1) << downscale << " " << x;
        EXPECT_NEAR(255 * images->colour(y, x, 1), 7 * (at.y - 0.5F), 1) << downscale << " " << y;
      }
    }
  }
}

TEST(WriteCapture, EstimatesMasksByTheCameras) {
  const Parts p(plain_lens());
  const std::atomic<bool> stop = false;
  PrepareOptions options = with_masks();
  options.masks = "estimate";
  write_capture(options, p.parts, p.folder / "out", stop);
  EXPECT_TRUE(load_capture(p.folder / "out", {}).masks_are_estimated);
  options.masks = "none";
  write_capture(options, p.parts, p.folder / "out", stop);
  EXPECT_FALSE(load_capture(p.folder / "out", {}).has_masks);
}

TEST(WriteCapture, NeedsATestView) {
  const Parts p(plain_lens(), 6, 3);
  const std::atomic<bool> stop = false;
  PrepareOptions options = with_masks();
  options.test_every = 8;
  EXPECT_THROW(write_capture(options, p.parts, p.folder / "out", stop), InputError);
}

TEST(GoodPoints, AreSeenOftenAndExactly) {
  ColmapModel model;
  model.points = {{{1, 0, 0}, {}, 0.5, 3}, {{2, 0, 0}, {}, 2.5, 9}, {{3, 0, 0}, {}, 0.5, 2}};
  EXPECT_EQ(good_points(model), std::vector<Vec3<double>>{Vec3<double>(1, 0, 0)});
}

TEST(SceneBounds, HoldCamerasAndMostPoints) {
  std::vector<Camera<double>> cameras(2);
  for (Camera<double>& camera : cameras) {
    camera.width = camera.height = 100;
    camera.focal_x = camera.focal_y = 100;
    camera.centre_x = camera.centre_y = 50;
  }
  cameras[1].position = {1, 0, 0};
  std::vector<Vec3<double>> points;
  points.reserve(10002);
  for (int i = 0; i <= 10000; ++i) points.emplace_back(0.2, 0, 2 + 0.0002 * i);
  points.emplace_back(0.5, 0, 1e6);
  const SceneBounds bounds = scene_bounds(points, cameras);
  EXPECT_NEAR(bounds.normalisation.centre.x, 0.5, 1e-9);
  EXPECT_NEAR(bounds.normalisation.centre.z, 1.975, 0.01);
  EXPECT_NEAR(1 / bounds.normalisation.scale, std::sqrt(1 + 3.95 * 3.95), 0.02);
  EXPECT_NEAR(bounds.near_plane / bounds.normalisation.scale, 2 / 1.2, 0.02);
  EXPECT_NEAR(bounds.far_plane / bounds.normalisation.scale, 4 * 1.2, 0.02);
  EXPECT_GT(scene_bounds({}, cameras).normalisation.scale, 0);
}

TEST(MoveIntoPlace, ReplacesOnlyWhatPrepareMade) {
  const TempFolder folder;
  const auto make = [&](const fs::path& at, const std::string& text) {
    fs::create_directories(at / "rgb");
    std::ofstream(at / "prepare.json") << text;
  };
  make(folder / "one", "first");
  move_into_place(folder / "one", folder / "capture", folder / "aside");
  make(folder / "two", "second");
  move_into_place(folder / "two", folder / "capture", folder / "aside");
  std::string text;
  std::ifstream(folder / "capture/prepare.json") >> text;
  EXPECT_EQ(text, "second");
  EXPECT_FALSE(fs::exists(folder / "aside"));
  EXPECT_FALSE(fs::exists(folder / "two"));

  fs::create_directory(folder / "capture/normal");
  EXPECT_THROW(check_place(folder / "capture"), InputError);
  fs::create_directories(folder / "other/things");
  EXPECT_THROW(check_place(folder / "other"), InputError);
  std::ofstream(folder / "file") << "x";
  EXPECT_THROW(check_place(folder / "file"), InputError);
  fs::create_directory(folder / "empty");
  EXPECT_NO_THROW(check_place(folder / "empty"));
  EXPECT_NO_THROW(check_place(folder / "absent"));
}

TEST(CheckMovable, RefusesAnEmptyFolderThatCannotGo) {
  const TempFolder folder;
  fs::create_directories(folder / "capture/rgb");
  fs::create_directory(folder / "empty");
  for (const char* name : {"capture", "empty", "absent"})
    EXPECT_NO_THROW(check_movable(folder / name, folder / "trial"));
  EXPECT_FALSE(fs::exists(folder / "absent"));
  EXPECT_FALSE(fs::exists(folder / "trial"));
  // On another file system, to which nothing is moved: as from a mount point.
  const fs::path elsewhere = "/proc/trial";
  EXPECT_NO_THROW(check_movable(folder / "capture", elsewhere));
  EXPECT_THAT(refusal_of([&] { check_movable(folder / "empty", elsewhere); }),
              testing::AllOf(HasSubstr("empty: output folder: found one that cannot be moved ("),
                             HasSubstr("name a folder below it")));
  EXPECT_TRUE(fs::exists(folder / "capture/rgb"));
  EXPECT_TRUE(fs::is_directory(folder / "empty") && fs::is_empty(folder / "empty"));
}

}  // namespace
}  // namespace traceflow::prepare
