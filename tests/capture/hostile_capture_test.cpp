#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "base/error.h"
#include "capture/capture.h"
#include "capture/image_cache.h"
#include "fake_capture.h"
#include "files/npy.h"
#include "support/refusal.h"

namespace traceflow {
namespace {

using Json = nlohmann::json;

// Loading must fail with an InputError that names the file and the field.
void expect_refused(const std::filesystem::path& folder, const std::string& file, const std::string& field) {
  try {
    load_capture(folder, {});
    ADD_FAILURE() << file << " " << field << " was accepted";
  } catch (const InputError& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find(file), std::string::npos) << text;
    EXPECT_NE(text.find(field), std::string::npos) << text;
  }
}

TEST(HostileCapture, missing_folders_and_files) {
  const TempFolder empty;
  expect_refused(empty / "nowhere", "nowhere", "");
  expect_refused(empty.path(), "dataset.json", "no capture");
  for (const char* name : {"dataset.json", "metadata.json", "scene.json"}) {
    NerfDsCapture fake(1);
    fake.save();
    std::filesystem::remove(fake.path() / name);
    expect_refused(fake.path(), name, "");
  }
}

TEST(HostileCapture, broken_json_in_every_file) {
  for (const char* name : {"dataset.json", "metadata.json", "scene.json", "camera/000000_left.json"}) {
    for (const std::string& text :
         {std::string(), std::string("{"), std::string("[]"), std::string("null"),
          std::string("{\"a\": NaN}"), std::string("\xff\xfe{}"), std::string(100000, '[')}) {
      NerfDsCapture fake(1);
      fake.save();
      fake.write_text(name, text);
      expect_refused(fake.path(), name, "");
    }
  }
}

TEST(HostileCapture, every_prefix_of_a_camera_is_refused) {
  NerfDsCapture fake(1);
  fake.save();
  const std::string whole = fake.cameras["000000_left"].dump();
  for (size_t length = 0; length < whole.size(); length += 5) {
    fake.write_text("camera/000000_left.json", whole.substr(0, length));
    expect_refused(fake.path(), "camera/000000_left.json", "");
  }
}

TEST(HostileCapture, camera_fields_missing_or_of_other_types) {
  const std::vector<std::pair<std::string, std::vector<Json>>> bad = {
      {"orientation",
       {nullptr,
        3,
        Json::array(),
        {{1, 0}, {0, 1}},
        {{2, 0, 0}, {0, 1, 0}, {0, 0, 1}},
        {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}},
        {{1, 0, 0}, {0, -1, 0}, {0, 0, 1}},
        {{1, 0, 0}, {0, 1, 0}, {0, 0, "1"}},
        {{1, 0, 0}, {0, 1, 0}, {0, 0, 1e308}}}},
      {"position", {nullptr, "here", {1, 2}, {1, 2, nullptr}, {1, 2, 3, 4}}},
      {"focal_length", {nullptr, 0, -5, 1e-300, 1e300, "10", Json::array({10})}},
      {"principal_point", {nullptr, 6, {6}, {1e300, 4}, {"6", "4"}}},
      {"image_size", {nullptr, 12, {0, 8}, {-12, 8}, {12, 1e300}, {12}}},
      {"pixel_aspect_ratio", {0, -1, "1"}},
      {"skew", {"0", {0}}},
      {"radial_distortion", {0.1, {0.1}, {0.1, 0.1, "0"}, {-50, 0, 0}, {1e300, 0, 0}}},
      {"tangential_distortion", {0.1, {0.1, 0.1, 0.1}}},
      {"tangential", {0.1, {0.1}}}};
  for (const auto& [field, values] : bad) {
    for (const Json& value : values) {
      NerfDsCapture fake(1);
      fake.cameras["000000_left"][field] = value;
      fake.save();
      const std::string named = field == "tangential_distortion" ? "tangential"
                                : field == "radial_distortion"   ? "distortion"
                                                                 : field;
      expect_refused(fake.path(), "camera/000000_left.json", named);
    }
  }
}

TEST(HostileCapture, scene_fields) {
  const std::vector<std::pair<std::string, std::vector<Json>>> bad = {
      {"center", {nullptr, 1, {1, 2}, {1, 2, "3"}}},
      {"scale", {nullptr, 0, -1, 1e300, "1"}},
      {"near", {"0.1"}},
      {"far", {0.05, "2"}}};
  for (const auto& [field, values] : bad) {
    for (const Json& value : values) {
      NerfDsCapture fake(1);
      fake.scene[field] = value;
      fake.save();
      expect_refused(fake.path(), "scene.json", field);
    }
  }
}

TEST(HostileCapture, dataset_and_metadata_fields) {
  const std::vector<std::pair<std::string, Json>> bad = {
      {"train_ids", "all"},     {"train_ids", {1.5}},
      {"train_ids", {nullptr}}, {"train_ids", {"../../etc/passwd"}},
      {"train_ids", {""}},      {"train_ids", {".."}},
      {"train_ids", {"a\nb"}},  {"train_ids", {std::string(300, 'a')}},
      {"val_ids", {{"a", 1}}}};
  for (const auto& [field, value] : bad) {
    NerfDsCapture fake(1);
    fake.dataset[field] = value;
    fake.save();
    expect_refused(fake.path(), "dataset.json", field);
  }
  for (const Json& time : {Json("zero"), Json(-1), Json(nullptr), Json::array({0})}) {
    for (const char* key : {"time_id", "warp_id"}) {
      NerfDsCapture fake(1);
      fake.metadata["000000_left"] = {{key, time}};
      fake.save();
      expect_refused(fake.path(), "metadata.json", "000000_left");
    }
  }
  for (const Json& entry : {Json(3), Json("zero"), Json::array({{"time_id", 0}})}) {
    NerfDsCapture fake(1);
    fake.metadata["000000_left"] = entry;
    fake.save();
    expect_refused(fake.path(), "metadata.json", "000000_left");
  }
  NerfDsCapture fake(1);
  fake.dataset = Json::object();
  fake.save();
  expect_refused(fake.path(), "dataset.json", "train_ids");
}

TEST(HostileCapture, nothing_to_train_on) {
  NerfDsCapture fake(1);
  std::filesystem::remove(fake.path() / "rgb/1x/000000_left.png");
  fake.save();
  expect_refused(fake.path(), "training views", "");
  std::filesystem::remove_all(fake.path() / "rgb");
  expect_refused(fake.path(), "rgb", "no images");
  std::filesystem::create_directories(fake.path() / "rgb/2x");
  expect_refused(fake.path(), "rgb", "2x");
}

TEST(HostileCapture, broken_pixels_and_arrays) {
  for (const char* name :
       {"rgb/1x/000000_left.png", "mask/1x/000000_left.png.png", "resized_mask/1x/000000_left.png.png",
        "normal/1x/000000_left.png", "points.npy", "normal.npy", "normal.npz"}) {
    for (const std::string& bytes : {std::string(), std::string("text"), std::string("\x89PNG\r\n\x1a\n")}) {
      NerfDsCapture fake(1);
      fake.save();
      fake.write_text(name, bytes);
      expect_refused(fake.path(), name, "");
    }
  }
}

TEST(HostileCapture, points_of_other_shapes) {
  for (const Shape& shape : {Shape{5}, Shape{5, 2}, Shape{5, 3, 1}}) {
    NerfDsCapture fake(1);
    fake.save();
    write_npy(fake.path() / "points.npy", Tensor<float>(shape));
    expect_refused(fake.path(), "points.npy", "shape");
  }
  NerfDsCapture fake(1);
  fake.save();
  write_npy(fake.path() / "points.npy", Tensor<float>({0, 3}));
  EXPECT_TRUE(load_capture(fake.path(), {}).points.empty());
}

// Small on the disk, they would take gigabytes as numbers.
TEST(HostileCapture, priors_of_more_pixels_than_a_picture_may_have) {
  for (const Shape& shape : {Shape{1, 1, 32769, 3}, Shape{1, 32769, 1, 3}, Shape{1, 32768, 8193, 3}}) {
    NerfDsCapture fake(1);
    fake.save();
    fake.write_zeros("normal.npy", shape);
    expect_refused(fake.path(), "normal.npy: shape: found " + shape.to_string(),
                   "expected at most 32,768 pixels a side and 2²⁸ in all");
  }
  NerfDsCapture fake(1);
  fake.save();
  fake.write_zeros("normal.npy", {1, 1, 32768, 3});
  EXPECT_TRUE(load_capture(fake.path(), {}).has_normal_priors);
}

TEST(HostileCapture, true_depths_of_more_pixels_than_a_picture_may_have) {
  for (const Shape& shape : {Shape{1, 32769}, Shape{32769, 1, 1}, Shape{32768, 8193}, Shape{1, 32768}}) {
    NerfDsCapture fake(1);
    fake.save();
    fake.write_zeros("truth/depth/000000_right.npy", shape);
    const Capture capture = load_capture(fake.path(), {});
    const std::string said = refusal_of([&] { load_truth(capture, capture.test[0]); });
    if (shape == Shape{1, 32768}) {
      EXPECT_EQ(said, "accepted");
    } else {
      EXPECT_THAT(said, testing::HasSubstr("000000_right.npy: shape: found " + shape.to_string() +
                                           ", expected at most 32,768 pixels a side and 2²⁸ in all"));
    }
  }
}

TEST(HostileCapture, more_points_than_are_read) {
  NerfDsCapture fake(1);
  fake.save();
  fake.write_zeros("points.npy", {10'000'001, 3});
  expect_refused(fake.path(), "points.npy: shape: found 10000001x3", "expected at most 10000000 points");
}

TEST(HostileCapture, a_photograph_cut_short_fails_when_it_is_decoded) {
  NerfDsCapture fake(1);
  fake.save();
  const auto path = fake.path() / "rgb/1x/000000_left.png";
  const Capture capture = load_capture(fake.path(), {});
  std::filesystem::resize_file(path, std::filesystem::file_size(path) - 20);
  EXPECT_THROW(load_images(capture, capture.train[0]), InputError);
  fake.write_image("rgb/1x/000000_left.png", Tensor<uint8_t>({2, 2, 3}));
  EXPECT_THROW(load_images(capture, capture.train[0]), InputError);
}

TEST(HostileCapture, options_out_of_range) {
  NerfDsCapture fake(1);
  fake.save();
  for (const int downscale : {0, -1, 65}) {
    CaptureOptions options;
    options.downscale = downscale;
    EXPECT_THROW(load_capture(fake.path(), options), InputError);
  }
  CaptureOptions options;
  options.cache_mebibytes = -1;
  EXPECT_THROW(load_capture(fake.path(), options), InputError);
}

}  // namespace
}  // namespace traceflow
