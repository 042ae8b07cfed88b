#include <algorithm>

#include "fake_formats.h"
#include "loaded_capture.h"

namespace traceflow {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

TEST(ColmapCapture, cameras_times_split_and_points) {
  for (const char* extension : {".png", ".jpg"}) {
    ColmapCapture fake(10, extension);
    fake.save();
    const Capture capture = load_capture(fake.path(), {});
    EXPECT_EQ(capture.format, "colmap");
    EXPECT_THAT(ids(capture.test), ElementsAre("frame_0", "frame_8"));
    EXPECT_THAT(ids(capture.train), ElementsAre("frame_1", "frame_2", "frame_3", "frame_4", "frame_5",
                                                "frame_6", "frame_7", "frame_9"));
    EXPECT_THAT(capture.warnings, IsEmpty());
    EXPECT_EQ(capture.points.shape(), (Shape{50, 3}));
    const View& view = capture.train[2];
    EXPECT_FLOAT_EQ(view.time, 3.0F / 9);
    EXPECT_FLOAT_EQ(view.camera.focal_y, 11);
    const Vec3<double> place = capture.normalisation.in_capture(Vec3<double>(view.camera.position));
    EXPECT_LT(length(place - Vec3<double>(0.3, 0, 0)), 1e-6);
    // JPEG is not exact, and these pixels are noise to it.
    expect_pixels(capture, view, fake.image(3), extension == std::string(".png") ? 0.01 : 40);
  }
}

TEST(ColmapCapture, text_a_plain_sparse_folder_the_top_and_archives_say_the_same) {
  ColmapCapture fake(10);
  fake.save();
  const std::string expected = summary(load_capture(fake.path(), {}));
  EXPECT_EQ(summary(load_capture(zipped(fake.path(), fake.path() / "../a.zip"), {})), expected);
  std::filesystem::remove(fake.path() / "../a.zip");
  for (const char* folder : {"sparse", "."}) {
    std::filesystem::remove_all(fake.path() / "sparse");
    fake.model.save_text(fake.path() / folder);
    EXPECT_EQ(summary(load_capture(fake.path(), {})), expected) << folder;
  }
}

TEST(ColmapCapture, smaller_images_are_taken_where_they_are) {
  ColmapCapture fake(4);
  fake.save();
  const Tensor<uint8_t> small({4, 6, 3});
  for (int i = 0; i < 4; ++i) fake.write_image("images_2/frame_" + std::to_string(i) + ".png", small);
  CaptureOptions options;
  options.downscale = 2;
  const Capture capture = load_capture(fake.path(), options);
  EXPECT_FLOAT_EQ(capture.train[0].camera.focal_x, 5);
  expect_pixels(capture, capture.train[0], small, 0.01);
  std::filesystem::remove_all(fake.path() / "images_2");
  const Capture filtered = load_capture(fake.path(), options);
  EXPECT_EQ(filtered.train[0].camera.width, 6);
  EXPECT_FLOAT_EQ(filtered.train[0].camera.focal_x, 5);
}

TEST(ColmapCapture, two_cameras_side_by_side_share_their_times) {
  ColmapCapture fake(0);
  for (int i = 0; i < 6; ++i) {
    const std::string name = (i < 3 ? "left/" : "right/") + std::to_string(i % 3) + ".png";
    fake.model.images.push_back({static_cast<uint32_t>(i), {1, 0, 0, 0}, {0.1 * i, 0, 0}, 1, name, {}});
    fake.write_photograph("images/" + name, i);
  }
  fake.save();
  CaptureOptions options;
  options.test_every = 0;
  const Capture capture = load_capture(fake.path(), options);
  EXPECT_THAT(ids(capture.train), ElementsAre("left_0", "left_1", "left_2", "right_0", "right_1", "right_2"));
  EXPECT_FLOAT_EQ(capture.train[1].time, 0.5F);
  EXPECT_FLOAT_EQ(capture.train[4].time, 0.5F);
  EXPECT_EQ(capture.images->source("right_1").rig_camera, "right");
  options.times = CaptureTimes::none;
  const Capture still = load_capture(fake.path(), options);
  EXPECT_EQ(still.train[4].time, 0);
  EXPECT_THAT(still.warnings,
              Contains(tells("one-time", Severity::notice, "all training views are of one time")));
}

TEST(ColmapCapture, what_is_missing_or_left_over_is_said) {
  ColmapCapture fake(10);
  fake.save();
  std::filesystem::remove(fake.path() / "images/frame_3.png");
  fake.write_photograph("images/blurred.png", 1);
  fake.write_text("images/Thumbs.db", "x");
  fake.write_text("transforms.json", "{}");
  fake.model.save_text(fake.path() / "sparse/1");
  const Capture capture = load_capture(fake.path(), {});
  // What is left is split.
  EXPECT_THAT(ids(capture.test), ElementsAre("frame_0", "frame_9"));
  EXPECT_EQ(capture.train.size(), 7U);
  EXPECT_THAT(capture.warnings,
              Contains(tells("missing-image", Severity::problem,
                             "1 of 10 registered views have no image (frame_3): left out")));
  EXPECT_THAT(capture.warnings, Contains(says("1 image has no camera (images/blurred.png)")));
  EXPECT_THAT(capture.warnings,
              Contains(tells("several-models", Severity::problem, "sparse/0 is read, sparse/1 not")));
  EXPECT_THAT(capture.warnings, Contains(tells("other-format", Severity::notice, "--format transforms")));
  const auto missing = std::find_if(capture.warnings.begin(), capture.warnings.end(),
                                    [](const Finding& f) { return f.kind == "missing-image"; });
  EXPECT_THAT(missing->views, ElementsAre("frame_3"));
  EXPECT_THAT(missing->files, ElementsAre("images/frame_3.png"));
}

// A rig's cameras have their own folders, with the same names in them.
struct RigCapture : ColmapCapture {
  RigCapture() : ColmapCapture(0) {}
  void add(const std::string& name) {
    const auto i = static_cast<uint32_t>(model.images.size());
    model.images.push_back({i + 1, {1, 0, 0, 0}, {0.1 * i, 0, 0}, 1, name, {}});
    write_photograph("images/" + name, static_cast<int>(i));
  }
};

TEST(ColmapCapture, photographs_of_a_rig_without_camera_are_named_by_their_folders) {
  RigCapture fake;
  for (const char* name : {"left/1.png", "left/2.png", "right/1.png"}) fake.add(name);
  fake.write_photograph("images/right/2.png", 7);
  fake.write_photograph("images/back/1.png", 8);
  fake.write_photograph("masks/left/1.png", 9);
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  ASSERT_THAT(capture.warnings, Contains(says("2 images have no camera")));
  const auto left_over = std::find_if(capture.warnings.begin(), capture.warnings.end(),
                                      [](const Finding& f) { return f.kind == "unregistered-image"; });
  EXPECT_THAT(left_over->files, ElementsAre("images/back/1.png", "images/right/2.png"));
}

// COLMAP drops pictures; they were taken all the same.
TEST(ColmapCapture, photographs_without_camera_keep_their_places_in_time) {
  RigCapture fake;
  for (const char* name : {"90.png", "91.png", "93.png", "100.png"}) fake.add(name);
  for (const int n : {92, 94, 95, 96, 97, 98, 99})
    fake.write_photograph("images/" + std::to_string(n) + ".png", n);
  fake.write_photograph("images/91_depth.png", 1);
  fake.save();
  CaptureOptions options;
  options.test_every = 0;
  const Capture capture = load_capture(fake.path(), options);
  ASSERT_THAT(ids(capture.train), ElementsAre("90", "91", "93", "100"));
  EXPECT_FLOAT_EQ(capture.train[1].time, 0.1F);
  EXPECT_FLOAT_EQ(capture.train[2].time, 0.3F);
  EXPECT_FLOAT_EQ(capture.train[3].time, 1);
}

// A Mac lays one beside each file that it copies to a foreign disk.
TEST(ColmapCapture, hidden_files_are_no_photographs) {
  ColmapCapture fake(10, ".jpg");
  for (int i = 0; i < 10; ++i) fake.write_text("images/._frame_" + std::to_string(i) + ".jpg", "Mac OS X");
  fake.save();
  EXPECT_THAT(load_capture(fake.path(), {}).warnings, IsEmpty());
}

TEST(ColmapCapture, smaller_images_are_enough) {
  ColmapCapture fake(4);
  fake.save();
  std::filesystem::rename(fake.path() / "images", fake.path() / "images_4");
  EXPECT_THAT(refusal(fake.path()), HasSubstr("images: found images_4, expected images at full size"));
  CaptureOptions options;
  options.downscale = 4;
  const Capture capture = load_capture(fake.path(), options);
  EXPECT_EQ(capture.train.size(), 3U);
  EXPECT_EQ(capture.images->source("frame_1").image.path, "images_4/frame_1.png");
  EXPECT_EQ(capture.images->source("frame_1").factor, 1);
}

TEST(ColmapCapture, no_photographs_at_all_is_refused) {
  ColmapCapture fake(3);
  fake.save();
  std::filesystem::remove_all(fake.path() / "images");
  EXPECT_THAT(refusal(fake.path()), HasSubstr("none of the 3 photographs that sparse/0/images.bin names"));
}

}  // namespace
}  // namespace traceflow
