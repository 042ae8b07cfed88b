#include <fstream>
#include <functional>

#include "capture/pixels.h"
#include "fake_formats.h"
#include "files/npy.h"
#include "loaded_capture.h"

namespace traceflow {
namespace {

using Json = nlohmann::json;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

// As the depth camera leaves them where it saw nothing.
TEST(DyCheckCapture, transparent_pixels_are_not_known) {
  FakeCapture fake;
  fake.scene = {{"scale", 1.0}, {"center", {0.0, 0.0, 0.0}}, {"near", 0.1}, {"far", 2.0}};
  fake.add_view("0_00000", 0, 0, false);
  fake.add_view("0_00001", 1, 1, false);
  fake.write_text("splits/train.json", R"({"frame_names": ["0_00000", "0_00001"], "time_ids": [0, 1]})");
  fake.save();
  Tensor<uint8_t> rgba({fake.height, fake.width, 4});
  rgba.fill(255);
  for (const int channel : {0, 1, 2, 3}) rgba(2, 5, channel) = 0;
  fake.write_image("rgb/1x/0_00001.png", rgba);
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_TRUE(load_images(capture, capture.train[0])->known.empty());
  ViewImages images = *load_images(capture, capture.train[1]);
  ASSERT_EQ(images.known.shape(), (Shape{fake.height, fake.width}));
  Tensor<float> rendered(images.colour.shape());
  rendered.fill(0.25F);
  take_unknown(rendered, images);
  Tensor<float> gradient(images.colour.shape());
  gradient.fill(3);
  leave_unknown(images, gradient);
  for (int64_t y = 0; y < fake.height; ++y) {
    for (int64_t x = 0; x < fake.width; ++x) {
      const bool unknown = y == 2 && x == 5;
      EXPECT_EQ(images.known(y, x), unknown ? 0 : 1);
      for (int64_t c = 0; c < 3; ++c) {
        EXPECT_EQ(images.colour(y, x, c), unknown ? 0.25F : 1.0F);
        EXPECT_EQ(gradient(y, x, c), unknown ? 0 : 3);
      }
    }
  }

  CaptureOptions half;
  half.downscale = 2;
  const Capture smaller = load_capture(fake.path(), half);
  const Tensor<uint8_t> known = load_images(smaller, smaller.train[1])->known;
  for (int64_t y = 0; y < known.dim(0); ++y) {
    for (int64_t x = 0; x < known.dim(1); ++x) EXPECT_EQ(known(y, x), y == 1 && x == 2 ? 0 : 1);
  }

  CaptureOptions white;
  white.background = Background::white;
  const Capture before_white = load_capture(fake.path(), white);
  const auto all = load_images(before_white, before_white.train[1]);
  EXPECT_TRUE(all->known.empty());
  EXPECT_EQ(all->colour(2, 5, 0), 1);
}

TEST(NoTrainingViews, is_said_with_the_field_that_should_name_them) {
  NerfDsCapture nerf_ds;
  nerf_ds.dataset["train_ids"] = Json::array();
  nerf_ds.save();
  EXPECT_EQ(refusal(nerf_ds.path()),
            (nerf_ds.path() / "dataset.json").string() +
                ": train_ids: found an empty list, expected the ids of the views to train on; list them, or "
                "take train_ids and val_ids away, and ids is split");
  nerf_ds.dataset.erase("train_ids");
  nerf_ds.dataset.erase("val_ids");
  nerf_ds.save();
  EXPECT_EQ(load_capture(nerf_ds.path(), {}).format, "hypernerf-interp");

  FakeCapture dycheck;
  dycheck.scene = nerf_ds.scene;
  dycheck.add_view("0_00000", 0, 0, false);
  dycheck.write_text("splits/train.json", R"({"frame_names": [], "time_ids": []})");
  dycheck.save();
  EXPECT_EQ(refusal(dycheck.path()),
            (dycheck.path() / "splits/train.json").string() +
                ": frame_names: found an empty list, expected the frames to train on; list them");

  // The first of every eight tests.
  ColmapCapture colmap(1);
  colmap.save();
  EXPECT_EQ(refusal(colmap.path()),
            colmap.path().string() +
                ": training views: found none, and 1 test views, expected at least one; --test-every 0 "
                "trains on all views where the capture does not split them");
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
  Tensor<float> depth({8, 12, 1});
  depth.fill(3);
  std::filesystem::create_directories(fake.path() / "depth/1x");
  write_npy(fake.path() / "depth/1x/0_00000.npy", depth);
  fake.write_text("covisible/1x/val/1_00000.png", "x");
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
  EXPECT_THAT(capture.warnings, Contains(tells("not-used", Severity::notice, "covisible/ is not used")));
  EXPECT_FLOAT_EQ(load_images(capture, capture.train[0])->depth_prior(4, 6), 1.5) << "of the depth camera";

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

TEST(Formats, photographs_end_as_cameras_call_them) {
  for (const char* extension : {".png", ".jpg", ".jpeg", ".JPG", ".JPEG", ".PNG"}) {
    NerfDsCapture fake;
    const std::string image = "rgb/1x/000001_left";
    std::filesystem::rename(fake.path() / (image + ".png"), fake.path() / (image + extension));
    fake.save();
    const Capture capture = load_capture(fake.path(), {});
    EXPECT_EQ(capture.train.size(), 4U) << extension;
    EXPECT_EQ(capture.images->source("000001_left").image.path, image + extension);
  }
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
