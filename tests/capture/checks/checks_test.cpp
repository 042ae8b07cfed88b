#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "broken_capture.h"

// One thing is broken, and exactly that is found.
namespace traceflow {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::UnorderedElementsAre;

std::string all(const Inspection& inspection) {
  std::string text;
  for (const Finding& f : inspection.findings) text += f.kind + ": " + f.text + "\n";
  return text;
}

// The only finding; a test that has another fails with all of them.
Finding only(const BrokenCapture& capture, const std::string& kind, Severity severity = Severity::problem) {
  const Inspection found = capture.inspection();
  EXPECT_EQ(found.findings.size(), 1U) << all(found);
  if (found.findings.empty()) return Finding("nothing", "none");
  EXPECT_EQ(found.findings[0].kind, kind) << all(found);
  EXPECT_EQ(found.findings[0].severity, severity);
  EXPECT_EQ(found.findings[0].text.find('\n'), std::string::npos);
  return found.findings[0];
}

// The pixels' mean with eight neighbours, a few times.
void blur(Tensor<uint8_t>& image) {
  for (int round = 0; round < 3; ++round) {
    const Tensor<uint8_t> sharp = image;
    for (int64_t y = 1; y + 1 < image.dim(0); ++y)
      for (int64_t x = 1; x + 1 < image.dim(1); ++x)
        for (int64_t c = 0; c < 3; ++c) {
          int sum = 0;
          for (int64_t k = 0; k < 9; ++k) sum += sharp(y - 1 + k / 3, x - 1 + k % 3, c);
          image(y, x, c) = static_cast<uint8_t>(sum / 9);
        }
  }
}

TEST(CaptureChecks, finds_nothing_in_a_healthy_capture) {
  const Inspection found = BrokenCapture().inspection();
  EXPECT_TRUE(found.findings.empty()) << all(found);
  EXPECT_GT(found.sight.in_view, 0.2);
  EXPECT_EQ(found.pixels.views, 50);
  EXPECT_GT(found.pixels.prior_angle, 1);
  EXPECT_LT(found.pixels.prior_angle, 45);
}

TEST(CaptureChecks, names_missing_files_by_their_paths) {
  const BrokenCapture image, camera;
  std::filesystem::remove(image / BrokenCapture::image(5));
  Finding found = only(image, "missing-image");
  EXPECT_THAT(found.files, ElementsAre("rgb/1x/000005_left.png"));
  EXPECT_THAT(found.views, ElementsAre("000005_left"));
  std::filesystem::remove(camera / "camera/000007_left.json");
  found = only(camera, "missing-camera");
  EXPECT_THAT(found.files, ElementsAre("camera/000007_left.json"));
}

TEST(CaptureChecks, names_images_without_camera) {
  const BrokenCapture capture;
  std::filesystem::copy(capture / BrokenCapture::image(2), capture / "rgb/1x/holiday.png");
  std::filesystem::copy(capture / BrokenCapture::image(2), capture / "rgb/1x/000002_left_depth.png");
  std::ofstream(capture / "rgb/1x/notes.txt") << "no image";
  EXPECT_THAT(only(capture, "unregistered-image", Severity::notice).files, ElementsAre("rgb/1x/holiday.png"));
}

TEST(CaptureChecks, names_repeated_ids) {
  const BrokenCapture twice, both;
  twice.edit_json("dataset.json", [](auto& json) { json["train_ids"].push_back("000003_left"); });
  EXPECT_THAT(only(twice, "repeated-id").views, ElementsAre("000003_left"));
  both.edit_json("dataset.json", [](auto& json) { json["val_ids"].push_back("000004_left"); });
  EXPECT_THAT(only(both, "id-in-both-splits").views, ElementsAre("000004_left"));
}

TEST(CaptureChecks, finds_sizes_that_do_not_fit) {
  const BrokenCapture mask, prior, camera;
  write_png(mask / BrokenCapture::mask(3), Tensor<uint8_t>({54, 54}));
  mask.edit_image(BrokenCapture::mask(3), [](auto& pixels) { std::fill_n(pixels.row(20), 54 * 10, 255); });
  EXPECT_THAT(only(mask, "mask-size").views, ElementsAre("000003_left"));
  Tensor<uint8_t> square({54, 54, 3});
  const Tensor<uint8_t> wide = read_png(prior / BrokenCapture::prior(3));
  for (int64_t y = 0; y < 54; ++y)
    for (int64_t x = 0; x < 54; ++x) std::copy_n(&wide(y, x * 96 / 54, 0), 3, &square(y, x, 0));
  write_png(prior / BrokenCapture::prior(3), square);
  EXPECT_THAT(only(prior, "prior-size").views, ElementsAre("000003_left"));
  camera.edit_camera(6, [](auto& json) { json["image_size"] = {96, 60}; });
  EXPECT_THAT(only(camera, "camera-size").views, ElementsAre("000006_left"));
}

TEST(CaptureChecks, finds_a_camera_that_stands_apart) {
  const BrokenCapture capture;
  const Capture before = load_capture(capture / "", {});
  // Back along its own axis: it still sees what the others see.
  capture.edit_camera(4, [](auto& json) {
    for (size_t k = 0; k < 3; ++k)
      json["position"][k] =
          json["position"][k].template get<double>() - 12 * json["orientation"][2][k].template get<double>();
  });
  const Finding found = only(capture, "camera-apart");
  EXPECT_THAT(found.views, ElementsAre("000004_left"));
  EXPECT_GT(*found.value, *found.threshold);
  // Without that camera the extent is nearly what it was.
  const size_t at = found.text.find("extent would be ");
  ASSERT_NE(at, std::string::npos) << found.text;
  EXPECT_NEAR(std::stod(found.text.substr(at + 16)), before.extent, 0.1 * before.extent);
}

TEST(CaptureChecks, finds_a_camera_that_looks_away) {
  const BrokenCapture capture;
  capture.edit_camera(8, [](auto& json) {
    for (const size_t row : {size_t{0}, size_t{2}})
      for (auto& v : json["orientation"][row]) v = -v.template get<double>();
  });
  std::filesystem::remove(capture / BrokenCapture::prior(8));  // it is of another direction
  const Inspection found = capture.inspection();
  ASSERT_EQ(found.findings.size(), 2U) << all(found);
  EXPECT_EQ(found.findings[0].kind, "missing-prior");
  EXPECT_EQ(found.findings[1].kind, "looks-away");
  EXPECT_THAT(found.findings[1].views, ElementsAre("000008_left"));
  EXPECT_GT(*found.findings[1].value, 120);
}

TEST(CaptureChecks, finds_gaps_in_time) {
  const BrokenCapture capture;
  capture.edit_json("metadata.json", [](auto& json) {
    for (auto& [id, entry] : json.items()) {
      const int frame = entry["time_id"];
      if (frame > 5) entry["time_id"] = frame + 9;
    }
  });
  const Finding found = only(capture, "time-gap");
  EXPECT_THAT(found.views, ElementsAre("000005_left", "000006_left"));
  EXPECT_NEAR(*found.value, 10, 1e-3);
  EXPECT_THAT(found.text, HasSubstr("10 times the usual step"));
}

// Times are kept in single precision: of 46 steps some five are a little more than five.
TEST(CaptureChecks, says_nothing_of_five_steps_and_what_rounding_adds) {
  const BrokenCapture capture;
  capture.edit_json("metadata.json", [](auto& json) {
    for (auto& [id, entry] : json.items()) {
      const int frame = entry["time_id"];
      entry["time_id"] = frame + (frame > 7 ? 4 : 0) + (frame == 39 ? 3 : 0);
    }
  });
  const Inspection found = capture.inspection();
  EXPECT_TRUE(found.findings.empty()) << all(found);
}

TEST(CaptureChecks, finds_two_views_of_a_camera_at_one_time) {
  const BrokenCapture capture;
  capture.edit_json("metadata.json", [](auto& json) { json["000005_left"]["time_id"] = 4; });
  EXPECT_THAT(only(capture, "repeated-time").views, UnorderedElementsAre("000004_left", "000005_left"));
}

TEST(CaptureChecks, finds_a_blurred_picture) {
  const BrokenCapture capture;
  capture.edit_image(BrokenCapture::image(6), blur);
  const Finding found = only(capture, "blur");
  EXPECT_THAT(found.views, ElementsAre("000006_left"));
  EXPECT_LT(*found.value, *found.threshold);
}

TEST(CaptureChecks, finds_a_dark_picture_and_does_not_call_it_blurred) {
  const BrokenCapture capture;
  capture.edit_image(BrokenCapture::image(6), [](auto& pixels) {
    for (uint8_t& v : pixels.values()) v = static_cast<uint8_t>(v * 0.5);
  });
  const Finding found = only(capture, "exposure-jump");
  EXPECT_THAT(found.views, ElementsAre("000006_left"));
  EXPECT_NEAR(*found.value, -2.2 * std::log2(0.5), 0.25);
}

TEST(CaptureChecks, finds_a_change_of_exposure_that_lasts) {
  const BrokenCapture capture;
  for (int frame = 7; frame < 40; ++frame) {
    capture.edit_image(BrokenCapture::image(frame), [](auto& pixels) {
      for (uint8_t& v : pixels.values()) v = static_cast<uint8_t>(v * 0.7);
    });
  }
  EXPECT_THAT(only(capture, "exposure-jump").views, ElementsAre("000007_left"));
}

TEST(CaptureChecks, finds_a_frozen_picture) {
  const BrokenCapture capture;
  std::filesystem::copy(capture / BrokenCapture::image(4), capture / BrokenCapture::image(5),
                        std::filesystem::copy_options::overwrite_existing);
  const Finding found = only(capture, "frozen");
  EXPECT_THAT(found.views, ElementsAre("000005_left"));
  EXPECT_EQ(*found.value, 0);
}

TEST(CaptureChecks, says_nothing_of_neighbours_in_a_collection_of_photographs) {
  const BrokenCapture capture;
  capture.edit_image(BrokenCapture::image(6), blur);
  // Far pictures stand side by side.
  capture.edit_json("metadata.json", [](auto& json) {
    for (int frame = 0; frame < 40; ++frame) json[BrokenCapture::id(frame)]["time_id"] = 7 * frame % 40;
  });
  const Inspection found = capture.inspection();
  EXPECT_TRUE(found.findings.empty()) << all(found);
}

TEST(CaptureChecks, finds_pictures_of_one_colour) {
  const BrokenCapture capture;
  capture.edit_image(BrokenCapture::image(9), [](auto& pixels) { pixels.fill(90); });
  const Finding found = only(capture, "one-colour");
  EXPECT_THAT(found.views, ElementsAre("000009_left"));
  const BrokenCapture green;
  green.edit_image(BrokenCapture::image(9), [](auto& pixels) {
    for (int64_t i = 0; i < pixels.size(); ++i) pixels[i] = i % 3 == 1 ? 100 : 80;
  });
  EXPECT_THAT(only(green, "one-colour").views, ElementsAre("000009_left"));
}

TEST(CaptureChecks, finds_masks_that_are_empty_full_or_inverted) {
  const BrokenCapture empty, full, inverted;
  empty.edit_image(BrokenCapture::mask(1), [](auto& pixels) { pixels.fill(0); });
  EXPECT_THAT(only(empty, "mask-empty", Severity::notice).views, ElementsAre("000001_left"));
  full.edit_image(BrokenCapture::mask(2), [](auto& pixels) { pixels.fill(255); });
  EXPECT_THAT(only(full, "mask-full").views, ElementsAre("000002_left"));
  for (const auto& file : std::filesystem::directory_iterator(inverted / "mask/1x")) {
    inverted.edit_image("mask/1x/" + file.path().filename().string(), [](auto& pixels) {
      for (uint8_t& v : pixels.values()) v = static_cast<uint8_t>(255 - v);
    });
  }
  only(inverted, "mask-inverted");
}

TEST(CaptureChecks, finds_priors_that_are_empty_or_turned) {
  const BrokenCapture empty, turned;
  empty.edit_image(BrokenCapture::prior(10), [](auto& pixels) { pixels.fill(0); });
  EXPECT_THAT(only(empty, "prior-empty").views, ElementsAre("000010_left"));
  turned.edit_image(BrokenCapture::prior(10), [](auto& pixels) {
    for (uint8_t& v : pixels.values()) v = static_cast<uint8_t>(255 - v);
  });
  const Finding found = only(turned, "prior-disagrees");
  EXPECT_THAT(found.views, ElementsAre("000010_left"));
  EXPECT_GT(*found.value, 120);
}

TEST(CaptureChecks, does_not_compare_the_priors_of_four_views) {
  const BrokenCapture capture;
  for (int frame = 4; frame < 40; ++frame) std::filesystem::remove(capture / BrokenCapture::prior(frame));
  capture.edit_image(BrokenCapture::prior(2), [](auto& pixels) {
    for (uint8_t& v : pixels.values()) v = static_cast<uint8_t>(255 - v);
  });
  EXPECT_EQ(only(capture, "missing-prior").views.size(), 36U);
}

TEST(CaptureChecks, finds_points_behind_the_cameras_and_far_out) {
  const BrokenCapture behind, far;
  const auto camera = BrokenCapture::Json::parse(std::ifstream(behind / "camera/000000_left.json"));
  const auto move = [&](Tensor<float>& points, int64_t count, float by) {
    for (int64_t i = 0; i < count; ++i)
      for (int k = 0; k < 3; ++k)
        points(i, k) = camera["position"][static_cast<size_t>(k)].get<float>() +
                       by * camera["orientation"][2][static_cast<size_t>(k)].get<float>();
  };
  behind.edit_points([&](auto& points) { move(points, 750, -3); });
  EXPECT_NEAR(*only(behind, "points-behind").value, 0.5, 1e-6);
  far.edit_points([&](auto& points) { move(points, 2, 400); });
  EXPECT_THAT(only(far, "points-far", Severity::notice).text, HasSubstr("2 of 1500 points"));
}

}  // namespace
}  // namespace traceflow
