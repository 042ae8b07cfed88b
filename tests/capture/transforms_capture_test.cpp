#include <functional>

#include "fake_formats.h"
#include "loaded_capture.h"

namespace traceflow {
namespace {

using Json = nlohmann::json;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

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

// A file that is not used may name any number of images that are nowhere, of another machine too.
TEST(SyntheticCapture, paths_are_found_by_their_ends_among_many_that_are_nowhere) {
  SyntheticCapture fake;
  fake.save();
  const std::string alone = summary(load_capture(fake.path(), {}));
  Json& frames = fake.files["transforms_val.json"]["frames"];
  for (int i = 0; i < 3; ++i) {
    const std::string name = "r_1" + std::to_string(i) + ".png";
    fake.write_image("test/" + name, fake.image(i));
    frames.push_back(TransformsCapture::frame("/home/someone/lego/test/" + name, i));
  }
  fake.save();
  EXPECT_THAT(load_capture(fake.path(), {}).warnings, Not(Contains(says("no camera"))));
  fake.write_image("test/r_20.png", fake.image(0));
  for (int i = 0; i < 2000; ++i) {
    Json frame;
    frame["file_path"] =
        (i % 2 == 0 ? "/home/" : "C:\\") + std::to_string(i) + "/test/a/b/c/train/" + std::to_string(i);
    frames.push_back(frame);
  }
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_EQ(summary(capture), alone);
  EXPECT_THAT(capture.warnings, Contains(says("1 image has no camera (test/r_20.png)")));
}

TEST(SyntheticCapture, a_frame_that_is_written_in_two_ways_is_one) {
  SyntheticCapture fake;
  fake.files["transforms_test.json"]["frames"].push_back(
      TransformsCapture::frame("/home/someone/lego/train/r_0", 0));
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_EQ(capture.train.size(), 6U);
  EXPECT_EQ(capture.test.size(), 3U);
  EXPECT_THAT(capture.warnings,
              Contains(tells("repeated-id", Severity::problem, "train/r_0 named more than once: used once")));
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
  // Points lie beside the images, or where their own path ends.
  fake.write_text("sparse_pc.ply",
                  "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
                  "property float z\nend_header\n0 0 0\n0.1 0.2 0.3\n");
  fake.write_text("data/sparse_pc.ply", "of another capture");
  for (const char* points : {"/home/someone/data/sparse_pc.ply", "/mnt/scans/sparse_pc.ply"}) {
    fake.json()["ply_file_path"] = points;
    fake.save();
    const Capture with_points = load_capture(fake.path(), {});
    ASSERT_EQ(with_points.points.shape(), (Shape{2, 3})) << points;
    const auto told = std::find_if(with_points.warnings.begin(), with_points.warnings.end(),
                                   [](const Finding& f) { return f.kind == "path-outside"; });
    ASSERT_NE(told, with_points.warnings.end());
    EXPECT_THAT(told->files, Contains(points));
  }
  for (Json& frame : fake.json()["frames"]) frame["file_path"] = "../../etc/passwd";
  fake.save();
  EXPECT_THAT(refusal(fake.path()), HasSubstr("none of 1 images"));
}

// Masks and priors go by the ids, which lack the folder that all images share: missing ones share it too.
TEST(NgpCapture, a_missing_image_of_another_machine_changes_no_id) {
  for (const char* before : {"/home/someone/data/", "data/fox/", "../fox/"}) {
    NgpCapture fake(6);
    for (Json& frame : fake.json()["frames"])
      frame["file_path"] = before + frame["file_path"].get<std::string>();
    fake.save();
    std::filesystem::remove(fake.path() / "images/3.jpg");
    for (const int i : {0, 1, 2, 4, 5})
      fake.write_image("mask/1x/" + std::to_string(i) + ".png.png",
                       Tensor<uint8_t>({fake.height, fake.width}));
    const Capture capture = load_capture(fake.path(), {});
    EXPECT_THAT(ids(capture.test), ElementsAre("0")) << before;
    EXPECT_THAT(ids(capture.train), ElementsAre("1", "2", "4", "5")) << before;
    EXPECT_TRUE(capture.has_masks) << before;
    EXPECT_THAT(capture.warnings,
                Contains(tells("missing-image", Severity::problem, "1 of 6 listed views have no image (3)")));
    EXPECT_THAT(capture.warnings, Not(Contains(says("have no mask"))));
  }
}

TEST(NgpCapture, missing_images_of_a_rig_of_another_machine_are_told_apart) {
  NgpCapture fake(0);
  for (int i = 0; i < 6; ++i) {
    const std::string name = (i < 3 ? "images/left/" : "images/right/") + std::to_string(i % 3) + ".jpg";
    fake.json()["frames"].push_back(NgpCapture::frame("/home/someone/data/" + name, i));
    if (i % 3 != 1) fake.write_text(name, jpeg_bytes(fake.image(i), 100));
  }
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_THAT(ids(capture.test), ElementsAre("left_0"));
  EXPECT_THAT(ids(capture.train), ElementsAre("left_2", "right_0", "right_2"));
  ASSERT_THAT(capture.warnings, Contains(tells("missing-image", Severity::problem,
                                               "2 of 6 listed views have no image (left_1, right_1)")));
  const auto missing = std::find_if(capture.warnings.begin(), capture.warnings.end(),
                                    [](const Finding& f) { return f.kind == "missing-image"; });
  EXPECT_THAT(missing->files, ElementsAre("images/left/1.jpg", "images/right/1.jpg"));
}

TEST(NgpCapture, a_rolling_shutter_is_told_of) {
  NgpCapture fake(4);
  fake.json()["rolling_shutter"] = {0, 0, 0.01, 0};
  fake.json()["frames"][2]["rolling_shutter"] = {0, 0, 0, 0};
  fake.save();
  EXPECT_THAT(load_capture(fake.path(), {}).warnings,
              Contains(tells("not-used", Severity::notice, "3 frames say how their camera moved")));
  fake.json().erase("rolling_shutter");
  fake.save();
  EXPECT_THAT(load_capture(fake.path(), {}).warnings, Not(Contains(says("rolling_shutter"))));
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

// Folders of another purpose may be called by a size: they hold no smaller images of those at the top.
TEST(NgpCapture, images_at_the_top_are_not_taken_for_smaller_ones) {
  NgpCapture fake(3);
  for (Json& frame : fake.json()["frames"])
    frame["file_path"] = std::filesystem::path(frame["file_path"].get<std::string>()).filename().string();
  fake.json().erase("w");
  fake.json().erase("h");
  fake.save();
  for (const auto& entry : std::filesystem::directory_iterator(fake.path() / "images"))
    std::filesystem::rename(entry.path(), fake.path() / entry.path().filename());
  fake.write_text("renders_2/notes.txt", "");
  CaptureOptions options;
  const Camera<float> full = load_capture(fake.path(), options).train[0].camera;
  options.downscale = 2;
  const Camera<float> half = load_capture(fake.path(), options).train[0].camera;
  EXPECT_EQ(full.width, fake.width);
  EXPECT_FLOAT_EQ(full.focal_x, 10);
  EXPECT_EQ(half.width, fake.width / 2);
  EXPECT_FLOAT_EQ(half.focal_x, 5);
}

TEST(NgpCaptureHostile, each_is_refused_by_name) {
  const std::pair<std::function<void(Json&)>, const char*> cases[] = {
      {[](Json& j) { j.erase("frames"); }, "transforms.json: frames: found nothing"},
      {[](Json& j) { j["frames"] = 3; }, "transforms.json: frames: found 3, expected a list"},
      {[](Json& j) { j["frames"] = Json::array(); }, "transforms.json: frames: found an empty list"},
      {[](Json& j) { j["frames"][1].erase("file_path"); }, "frames[1].file_path: found nothing"},
      {[](Json& j) { j["frames"][1]["file_path"] = 7; }, "frames[1].file_path: found 7, expected a string"},
      {[](Json& j) { j["frames"][1].erase("transform_matrix"); },
       "frames[1].transform_matrix: found nothing"},
      {[](Json& j) { j["frames"][1]["transform_matrix"][2][2] = nullptr; },
       "frames[1].transform_matrix[2][2]"},
      {[](Json& j) { j["frames"][1]["time"] = "noon"; }, "frames[1].time: found \"noon\""},
      {[](Json& j) { j["frames"][1]["camera_model"] = "VR180_L"; }, "frames[1].camera_model: found VR180_L"},
      {[](Json& j) { j["frames"][1]["latlong"] = true; }, "frames[1].latlong: found a panorama"},
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

}  // namespace
}  // namespace traceflow
