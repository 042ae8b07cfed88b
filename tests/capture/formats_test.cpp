#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "capture/capture.h"
#include "capture/image_cache.h"
#include "fake_formats.h"
#include "support/refusal.h"

namespace traceflow {
namespace {

using Json = nlohmann::json;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

// A finding with this in its text.
auto says(const std::string& part) { return testing::Field("text", &Finding::text, HasSubstr(part)); }

// A finding of this kind with this in its text.
auto tells(const std::string& kind, Severity severity, const std::string& part) {
  return testing::AllOf(says(part), testing::Field("kind", &Finding::kind, kind),
                        testing::Field("severity", &Finding::severity, severity));
}

std::vector<std::string> ids(const std::vector<View>& views) {
  std::vector<std::string> result(views.size());
  std::transform(views.begin(), views.end(), result.begin(), [](const View& view) { return view.id; });
  return result;
}

std::string refusal(const std::filesystem::path& path, const CaptureOptions& options = {}) {
  return refusal_of([&] { load_capture(path, options); });
}

void expect_pixels(const Capture& capture, const View& view, const Tensor<uint8_t>& expected,
                   double tolerance) {
  const auto images = load_images(capture, view);
  ASSERT_EQ(images->colour.shape(), (Shape{expected.dim(0), expected.dim(1), 3}));
  for (int64_t i = 0; i < images->colour.size(); ++i)
    ASSERT_NEAR(255 * images->colour[i], expected[i], tolerance) << i;
}

// Everything that a reader found, as one text: two ways of giving a capture must agree in it.
std::string summary(const Capture& c) {
  std::string text = c.format;
  for (const auto* split : {&c.train, &c.test}) {
    for (const View& view : *split) {
      const auto& k = view.camera;
      text += "\n" + view.id + " " + std::to_string(view.time) + " " + std::to_string(k.focal_x) + " " +
              std::to_string(k.centre_y) + " " + std::to_string(k.position.x) + " " +
              std::to_string(k.position.y);
    }
  }
  return text + "\n" + std::to_string(c.points.size()) + " " + std::to_string(c.normalisation.scale);
}

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

TEST(SyntheticCapture, splits_poses_and_white_behind) {
  SyntheticCapture fake;
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_EQ(capture.format, "nerf-synthetic");
  EXPECT_THAT(ids(capture.train),
              ElementsAre("train_r_0", "train_r_1", "train_r_2", "train_r_3", "train_r_4", "train_r_5"));
  EXPECT_THAT(ids(capture.test), ElementsAre("test_r_0", "test_r_1", "test_r_2"));
  EXPECT_LT(length(capture.normalisation.centre), 1e-9);
  for (const View& view : capture.train) {
    EXPECT_NEAR(std::atan(6 / view.camera.focal_x), 0.5, 1e-6);
    // The origin lies on the axis, before the camera.
    const Vec3<float> origin = view.camera.point_in_camera(Vec3<float>(0));
    EXPECT_GT(origin.z, 0);
    EXPECT_NEAR(origin.x, 0, 1e-6);
    // The world's up is the picture's.
    EXPECT_LT(view.camera.point_in_camera(Vec3<float>(0, 0, 0.1F)).y, 0);
  }
}

TEST(SyntheticCapture, transparent_pixels_show_the_background) {
  SyntheticCapture fake;
  fake.save();
  for (const auto& [background, level] : {std::pair{Background::automatic, 255},
                                          {Background::white, 255},
                                          {Background::black, 0},
                                          {Background::grey, 128}}) {
    CaptureOptions options;
    options.background = background;
    const Capture capture = load_capture(fake.path(), options);
    Tensor<uint8_t> expected = fake.image(2);
    for (int64_t i = 0; i < expected.size(); ++i) {
      const int64_t pixel = i / 3;
      const double alpha = pixel % 3 == 0 ? 0 : pixel % 3 == 1 ? 1 : 100 / 255.0;
      expected[i] = static_cast<uint8_t>(std::lround(expected[i] * alpha + level * (1 - alpha)));
    }
    expect_pixels(capture, capture.train[2], expected, 0.51);
  }
}

TEST(SyntheticCapture, times_make_it_a_moving_one) {
  SyntheticCapture fake(true);
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_EQ(capture.format, "d-nerf");
  EXPECT_FLOAT_EQ(capture.train[3].time, 0.6F);
  EXPECT_FLOAT_EQ(capture.test[1].time, 0.2F);
  EXPECT_THAT(capture.warnings, Not(Contains(says("time 0"))));
  CaptureOptions options;
  options.times = CaptureTimes::none;
  EXPECT_EQ(load_capture(fake.path(), options).train[3].time, 0);
  fake.files["transforms_test.json"]["frames"][1].erase("time");
  for (Json& frame : fake.files["transforms_train.json"]["frames"])
    frame["time"] = frame["time"].get<double>() - 3;
  fake.save();
  const Capture shifted = load_capture(fake.path(), {});
  EXPECT_THAT(shifted.warnings,
              Contains(tells("missing-time", Severity::problem, "without a time (test/r_1)")));
  EXPECT_EQ(shifted.train[0].time, 0);
}

TEST(SyntheticCapture, times_in_any_unit_run_from_0_to_1) {
  for (const double first : {100.0, 3000.0, 1.69e9, -5.0}) {
    SyntheticCapture fake;
    Json &train = fake.files["transforms_train.json"]["frames"],
         &test = fake.files["transforms_test.json"]["frames"];
    for (size_t i = 0; i < train.size(); ++i) train[i]["time"] = first + 20.0 * static_cast<double>(i);
    for (Json& frame : test) frame["time"] = first + 60;
    test[1].erase("time");
    fake.save();
    const Capture capture = load_capture(fake.path(), {});
    EXPECT_FLOAT_EQ(capture.train[0].time, 0);
    EXPECT_FLOAT_EQ(capture.train[1].time, 0.2F);
    EXPECT_FLOAT_EQ(capture.train[5].time, 1);
    EXPECT_FLOAT_EQ(capture.test[0].time, 0.6F);
    EXPECT_FLOAT_EQ(capture.test[1].time, 0) << "taken for the first";
    EXPECT_THAT(capture.warnings, Contains(tells("missing-time", Severity::problem, "(test/r_1)")));
  }
}

TEST(SyntheticCapture, training_views_of_one_time_are_told) {
  SyntheticCapture fake(true);
  for (Json& frame : fake.files["transforms_train.json"]["frames"]) frame["time"] = 5;
  fake.save();
  EXPECT_THAT(load_capture(fake.path(), {}).warnings,
              Contains(tells("one-time", Severity::problem, "all training views are of one time")));
}

// Three files over one folder of images, of which two are used.
TEST(SyntheticCapture, images_of_files_that_are_not_used_are_not_left_over) {
  SyntheticCapture fake;
  const std::string splits[] = {"train", "test", "val"};
  for (const std::string& split : splits) {
    for (Json& frame : fake.files["transforms_" + split + ".json"]["frames"]) {
      std::string path = frame["file_path"];
      const std::string name = path.substr(path.rfind('/') + 1), moved = "all/" + split + name;
      std::filesystem::create_directories(fake.path() / "all");
      std::filesystem::rename(fake.path() / split / (name + ".png"), fake.path() / (moved + ".png"));
      frame["file_path"] = "./" + moved;
    }
  }
  fake.save();
  EXPECT_THAT(load_capture(fake.path(), {}).warnings, Not(Contains(says("no camera"))));
  fake.write_text("transforms_val.json", "not used");
  EXPECT_THAT(load_capture(fake.path(), {}).warnings, Contains(says("3 images have no camera")));
}

TEST(SyntheticCapture, what_is_wrong_in_the_test_file_is_told_of_it) {
  SyntheticCapture fake;
  fake.files["transforms_test.json"]["k1"] = -60;
  fake.save();
  EXPECT_THAT(refusal(fake.path()), HasSubstr("transforms_test.json: test/r_"));
  fake.files["transforms_test.json"].erase("k1");
  fake.files["transforms_test.json"]["frames"][1]["file_path"] = "test/a\u001b[2J";
  fake.save();
  EXPECT_THAT(refusal(fake.path()), HasSubstr("transforms_test.json: image names"));
}

TEST(NgpCapture, natural_order_split_and_intrinsics) {
  NgpCapture fake(12);
  fake.json()["k1"] = 0.01;
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_EQ(capture.format, "instant-ngp");
  EXPECT_THAT(ids(capture.test), ElementsAre("0", "8"));
  EXPECT_EQ(capture.train.front().id, "1");
  EXPECT_EQ(capture.train.back().id, "11");
  EXPECT_FLOAT_EQ(capture.train[0].camera.centre_x, 6.5F);
  CaptureOptions options;
  options.times = CaptureTimes::names;
  EXPECT_FLOAT_EQ(load_capture(fake.path(), options).train.back().time, 1);
  EXPECT_EQ(summary(load_capture(zipped(fake.path(), fake.path() / "../b.zip"), {})), summary(capture));
  std::filesystem::remove(fake.path() / "../b.zip");
}

TEST(NgpCapture, nerfstudio_splits_points_and_frames_with_their_own_lens) {
  NgpCapture fake(6);
  Json& json = fake.json();
  json["camera_model"] = "OPENCV";
  json["ply_file_path"] = "sparse_pc.ply";
  json["train_filenames"] = {"images/1.jpg", "images/3.jpg", "images/5.jpg"};
  json["val_filenames"] = {"images/2.jpg"};
  json["test_filenames"] = {"./images/4.jpg"};
  for (Json& frame : json["frames"]) {
    if (frame["file_path"] == "images/3.jpg") frame["fl_x"] = 20;
    frame["mask_path"] = "masks/a.png";
    frame["depth_file_path"] = "depth/a.png";
  }
  fake.save();
  fake.write_text(
      "sparse_pc.ply",
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float "
      "z\nproperty uint8 red\nend_header\n0 0 0 1\n0.1 0.2 0.3 4\n");
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_EQ(capture.format, "nerfstudio");
  EXPECT_THAT(ids(capture.train), ElementsAre("1", "3", "5"));
  EXPECT_THAT(ids(capture.test), ElementsAre("4"));
  EXPECT_EQ(capture.points.dim(0), 2);
  EXPECT_FLOAT_EQ(capture.train[0].camera.focal_x, 10);
  EXPECT_FLOAT_EQ(capture.train[1].camera.focal_x, 20);
  EXPECT_THAT(capture.warnings, Contains(tells("in-no-split", Severity::problem,
                                               "2 frames are in neither train_filenames nor")));
  EXPECT_THAT(capture.warnings, Not(Contains(says("no camera")))) << "what is left out has one";
  EXPECT_THAT(capture.warnings, Contains(tells("not-used", Severity::notice, "mask_path: not used")));
  EXPECT_THAT(capture.warnings, Contains(tells("not-used", Severity::notice, "depth images: not used")));
  fake.write_text("sparse_pc.ply", "broken");
  EXPECT_THAT(load_capture(fake.path(), {}).warnings,
              Contains(tells("points-unreadable", Severity::problem, "points not used: ")));
  std::filesystem::remove(fake.path() / "sparse_pc.ply");
  EXPECT_THAT(
      load_capture(fake.path(), {}).warnings,
      Contains(tells("points-unreadable", Severity::problem, "sparse_pc.ply (ply_file_path) is missing")));
}

TEST(NgpCapture, paths_of_another_machine_are_found_by_their_ends) {
  NgpCapture fake(6);
  for (Json& frame : fake.json()["frames"])
    frame["file_path"] = "/home/someone/data/" + frame["file_path"].get<std::string>();
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_EQ(capture.train.size(), 5U);
  EXPECT_THAT(capture.warnings,
              Contains(tells("path-outside", Severity::notice, "not in the capture as written")));
  for (Json& frame : fake.json()["frames"]) frame["file_path"] = "../../etc/passwd";
  fake.save();
  EXPECT_THAT(refusal(fake.path()), HasSubstr("none of 1 images"));
}

TEST(NgpCapture, paths_of_windows_and_from_another_folder_are_found_by_their_ends) {
  for (const char* before : {"C:\\data\\x\\", "data/fox/", "./a/b/c/d/"}) {
    NgpCapture fake(6);
    for (Json& frame : fake.json()["frames"])
      frame["file_path"] = before + frame["file_path"].get<std::string>();
    fake.json()["train_filenames"] = Json::array();
    for (int i = 0; i < 4; ++i)
      fake.json()["train_filenames"].push_back(before + ("images/" + std::to_string(i) + ".jpg"));
    fake.save();
    const Capture capture = load_capture(fake.path(), {});
    EXPECT_EQ(capture.train.size(), 4U) << before;
    EXPECT_THAT(capture.warnings,
                Contains(tells("path-outside", Severity::notice, "are not in the capture as written")));
    EXPECT_THAT(capture.warnings, Contains(says("2 frames are in neither")));
    EXPECT_THAT(capture.warnings, Not(Contains(says("no camera"))));
  }
  // Where some are as written, the others are missing, not elsewhere.
  NgpCapture fake(3);
  fake.json()["frames"][0]["file_path"] = "lost/images/1.jpg";
  fake.save();
  EXPECT_THAT(load_capture(fake.path(), {}).warnings,
              Contains(tells("missing-image", Severity::problem, "1 of 3 listed views")));
}

TEST(NgpCapture, smaller_images_are_enough) {
  NgpCapture fake(3);
  fake.save();
  std::filesystem::rename(fake.path() / "images", fake.path() / "images_4");
  EXPECT_THAT(refusal(fake.path()), HasSubstr("images: found images_4, expected images at full size"));
  CaptureOptions options;
  options.downscale = 4;
  EXPECT_EQ(load_capture(fake.path(), options).train.size(), 2U);
}

TEST(NgpCapture, names_with_dots_are_whole_names) {
  NgpCapture fake(0);
  for (const double angle : {0.0, 1.0, 2.0})
    fake.json()["frames"].push_back(
        NgpCapture::frame("images/1616." + std::to_string(int(angle) + 1), angle));
  for (int i = 0; i < 3; ++i)
    fake.write_image("images/1616." + std::to_string(i + 1) + ".png", fake.image(i));
  fake.write_image("images/1616.png", fake.image(9));
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_THAT(ids(capture.train), ElementsAre("1616.2", "1616.3"));
  expect_pixels(capture, capture.train[0], fake.image(1), 0.01);
  EXPECT_THAT(capture.warnings, Contains(says("1 image has no camera (images/1616.png)")));
}

TEST(NgpCapture, smaller_images_are_taken_where_they_are) {
  NgpCapture fake(3);
  fake.json().erase("w");
  fake.save();
  const Tensor<uint8_t> small({4, 6, 3});
  for (int i = 0; i < 3; ++i) fake.write_image("images_2/" + std::to_string(i) + ".png", small);
  CaptureOptions options;
  options.downscale = 2;
  const Capture capture = load_capture(fake.path(), options);
  EXPECT_EQ(capture.train[0].camera.width, 6);
  EXPECT_FLOAT_EQ(capture.train[0].camera.focal_x, 5);
  expect_pixels(capture, capture.train[0], small, 0.01);
}

TEST(NgpCapture, images_at_the_top_are_box_filtered) {
  NgpCapture fake(3);
  for (Json& frame : fake.json()["frames"])
    frame["file_path"] = std::filesystem::path(frame["file_path"].get<std::string>()).filename().string();
  fake.save();
  for (const auto& entry : std::filesystem::directory_iterator(fake.path() / "images"))
    std::filesystem::rename(entry.path(), fake.path() / entry.path().filename());
  CaptureOptions options;
  const int width = load_capture(fake.path(), options).train[0].camera.width;
  options.downscale = 2;
  EXPECT_EQ(load_capture(fake.path(), options).train[0].camera.width, width / 2);
}

TEST(NgpCaptureHostile, each_is_refused_by_name) {
  const std::pair<std::function<void(Json&)>, const char*> cases[] = {
      {[](Json& j) { j.erase("frames"); }, "transforms.json: frames: found nothing"},
      {[](Json& j) { j["frames"] = 3; }, "transforms.json: frames: found 3, expected a list"},
      {[](Json& j) { j["frames"] = Json::array(); }, "transforms.json: frames: found none of 0 images"},
      {[](Json& j) { j["frames"][1].erase("file_path"); }, "frames[1].file_path: found nothing"},
      {[](Json& j) { j["frames"][1]["file_path"] = 7; }, "frames[1].file_path: found 7, expected a string"},
      {[](Json& j) { j["frames"][1].erase("transform_matrix"); },
       "frames[1].transform_matrix: found nothing"},
      {[](Json& j) { j["frames"][1]["transform_matrix"][2][2] = nullptr; },
       "frames[1].transform_matrix[2][2]"},
      {[](Json& j) { j["frames"][1]["time"] = "noon"; }, "frames[1].time: found \"noon\""},
      {[](Json& j) { j["frames"][1]["camera_model"] = "VR180_L"; }, "frames[1].camera_model: found VR180_L"},
      {[](Json& j) { j.erase("fl_x"), j.erase("fl_y"); }, "no focal length"},
      {[](Json& j) { j["k1"] = -60; }, "transforms.json: images/"},
      {[](Json& j) { j["train_filenames"] = {3.5}; }, "train_filenames"},
      {[](Json& j) { j["w"] = 0; }, "transforms.json: w: found 0"}};
  for (const auto& [change, expected] : cases) {
    NgpCapture fake(4);
    change(fake.json());
    fake.save();
    EXPECT_THAT(refusal(fake.path()), HasSubstr(expected));
  }
}

TEST(DyCheckCapture, splits_give_views_and_times) {
  FakeCapture fake;
  fake.scene = {{"scale", 0.5}, {"center", {0.0, 0.0, 1.0}}, {"near", 0.1}, {"far", 2.0}};
  std::map<std::string, Json> splits = {
      {"train", {{"frame_names", Json::array()}, {"time_ids", Json::array()}}},
      {"val", {{"frame_names", Json::array()}, {"time_ids", Json::array()}}}};
  for (int t = 0; t < 4; ++t) {
    for (const int camera : {0, 1}) {
      const std::string id = std::to_string(camera) + "_0000" + std::to_string(t);
      fake.add_view(id, 2 * t + camera, 99 - t, false);
      Json& split = splits[camera == 0 ? "train" : "val"];
      split["frame_names"].push_back(id);
      split["time_ids"].push_back(t);
      split["camera_ids"].push_back(camera);
    }
  }
  fake.dataset = {{"ids", {"not looked at"}}};
  fake.save();
  fake.write_text("extra.json", R"({"factor": 2})");
  fake.write_text("depth/1x/0_00000.npy", "x");
  const auto save = [&] {
    for (const auto& [name, split] : splits) fake.write_text("splits/" + name + ".json", split.dump());
  };
  save();
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_EQ(capture.format, "dycheck");
  EXPECT_THAT(ids(capture.train), ElementsAre("0_00000", "0_00001", "0_00002", "0_00003"));
  EXPECT_THAT(ids(capture.test), ElementsAre("1_00000", "1_00001", "1_00002", "1_00003"));
  EXPECT_FLOAT_EQ(capture.test[2].time, 2.0F / 3);
  EXPECT_EQ(capture.images->source("1_00002").rig_camera, "1");
  EXPECT_EQ(capture.normalisation.scale, 0.5);
  EXPECT_THAT(capture.warnings, Contains(tells("not-used", Severity::notice, "depth/ is not used")));

  const std::pair<std::function<void()>, const char*> cases[] = {
      {[&] { splits["val"]["time_ids"].erase(0); },
       "splits/val.json: time_ids: found [1,2,3], expected a list of 4"},
      {[&] { splits["train"]["time_ids"][1] = -1; }, "splits/train.json: time_ids[1]: found -1"},
      {[&] { splits["train"]["frame_names"][1] = "../x"; },
       "splits/train.json: frame_names[1]: found the id \"../x\""},
      {[&] { splits["train"]["frame_names"][1] = "0_00000"; },
       "frame_names[1]: found 0_00000 a second time"}};
  for (const auto& [change, expected] : cases) {
    const auto whole = splits;
    change();
    save();
    EXPECT_THAT(refusal(fake.path()), HasSubstr(expected));
    splits = whole;
  }
  for (auto& [name, split] : splits) split["time_ids"] = Json(4, 0);
  save();
  EXPECT_THAT(load_capture(fake.path(), {}).warnings,
              Contains(tells("one-time", Severity::problem, "all training views are of one time")));
}

TEST(Formats, are_chosen_by_looking_or_by_name) {
  ColmapCapture both(4);
  both.save();
  NgpCapture transforms(4);
  transforms.save();
  std::filesystem::copy(transforms.path() / "transforms.json", both.path() / "transforms.json");
  std::filesystem::copy(transforms.path() / "images", both.path() / "images",
                        std::filesystem::copy_options::recursive);
  EXPECT_EQ(load_capture(both.path(), {}).format, "colmap");
  CaptureOptions options;
  options.format = CaptureFormat::transforms;
  EXPECT_EQ(load_capture(both.path(), options).format, "instant-ngp");
  const std::pair<CaptureFormat, const char*> missing[] = {
      {CaptureFormat::nerfies, "dataset.json: found no such file"},
      {CaptureFormat::dycheck, "splits/train.json: found no such file"},
      {CaptureFormat::colmap, "found no COLMAP model"}};
  for (const auto& [format, expected] : missing) {
    options.format = format;
    EXPECT_THAT(refusal(transforms.path(), options), HasSubstr(expected));
  }
  const TempFolder empty;
  for (const char* looked_for : {"dataset.json", "splits/train.json", "sparse/0", "transforms.json"})
    EXPECT_THAT(refusal(empty.path()), HasSubstr(looked_for));
  options.test_every = 1;
  EXPECT_THAT(refusal(transforms.path(), options), HasSubstr("test_every"));
}

// COLMAP and other programs' metadata.json lie side by side.
TEST(Formats, a_stray_metadata_file_makes_no_capture_of_nerfies) {
  ColmapCapture fake(4);
  fake.save();
  fake.write_text("metadata.json", "{}");
  EXPECT_EQ(load_capture(fake.path(), {}).format, "colmap");
  const TempFolder alone;
  std::ofstream(alone / "metadata.json") << "{}";
  EXPECT_THAT(refusal(alone.path()), HasSubstr("dataset.json: found no such file"));
}

TEST(Formats, times_can_be_those_of_the_names_in_all) {
  NerfDsCapture fake(3);
  for (auto& [id, entry] : fake.metadata.items()) entry["time_id"] = 2 - entry["time_id"].get<int>();
  fake.save();
  EXPECT_EQ(load_capture(fake.path(), {}).train[0].time, 1);
  CaptureOptions options;
  options.times = CaptureTimes::names;
  const Capture named = load_capture(fake.path(), options);
  EXPECT_FLOAT_EQ(named.train[0].time, 0);
  EXPECT_FLOAT_EQ(named.train[1].time, 0.4F);
  EXPECT_FLOAT_EQ(named.test[2].time, 1);
  options.times = CaptureTimes::none;
  const Capture still = load_capture(fake.path(), options);
  for (const View& view : still.train) EXPECT_EQ(view.time, 0);
  EXPECT_THAT(still.warnings, Contains(tells("one-time", Severity::notice, "one time")));
}

// A photograph that a viewer would turn: told, and taken as it is stored.
TEST(Formats, orientation_is_told) {
  ColmapCapture fake(2, ".jpg");
  fake.save();
  std::string jpeg = jpeg_bytes(fake.image(1), 95);
  const std::string exif =
      std::string("Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0", 32);
  jpeg.insert(2, "\xff\xe1" + std::string(1, '\0') + static_cast<char>(exif.size() + 2) + exif);
  fake.write_text("images/frame_1.jpg", jpeg);
  EXPECT_THAT(load_capture(fake.path(), {}).warnings, Contains(says("viewers turn the images of frame_1")));
}

}  // namespace
}  // namespace traceflow
