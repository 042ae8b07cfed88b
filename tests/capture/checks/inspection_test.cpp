#include "capture/checks/inspection.h"

#include <gtest/gtest.h>

#include "../fake_capture.h"
#include "files/npy.h"

namespace traceflow {
namespace {

bool names(const std::vector<std::string>& texts, const std::string& part) {
  return std::any_of(texts.begin(), texts.end(),
                     [&](const std::string& text) { return text.find(part) != std::string::npos; });
}
bool names(const std::vector<Finding>& findings, const std::string& part) {
  return std::any_of(findings.begin(), findings.end(),
                     [&](const Finding& f) { return f.text.find(part) != std::string::npos; });
}

TEST(Inspect, counts_what_is_there) {
  NerfDsCapture fake;
  Tensor<uint8_t> mask({8, 12});
  for (int64_t i = 0; i < 24; ++i) mask[i] = 255;
  for (const char* id : {"000000_left", "000001_left", "000000_right"}) {
    fake.write_image("mask/1x/" + std::string(id) + ".png.png", mask);
  }
  Tensor<uint8_t> normal({8, 12, 3});
  for (int64_t i = 0; i < 72; ++i) normal[3 * i] = 128, normal[3 * i + 1] = 128, normal[3 * i + 2] = 255;
  fake.write_image("normal/1x/000000_left.png", normal);
  fake.write_image("truth/normal/000001_right.png", normal);
  Tensor<float> points({2, 3});
  points(1, 0) = 1;
  points(1, 2) = 4;
  write_npy(fake.path() / "points.npy", points);
  fake.cameras["000001_left"]["orientation"] = {{0, 0, -1}, {0, 1, 0}, {1, 0, 0}};
  fake.save();
  const Inspection found = inspect(load_capture(fake.path(), {}));
  EXPECT_EQ(found.train.views, 4);
  EXPECT_EQ(found.test.views, 4);
  EXPECT_EQ(found.train.masks, 2);
  EXPECT_EQ(found.test.masks, 1);
  EXPECT_EQ(found.train.normal_priors, 1);
  EXPECT_EQ(found.test.truth_normals, 1);
  EXPECT_EQ(found.test.truth_depths, 0);
  EXPECT_EQ(found.train.times, 4);
  EXPECT_EQ(found.train.last_time, 1);
  ASSERT_EQ(found.sizes.size(), 1U);
  EXPECT_EQ(found.sizes.at({12, 8}), 8);
  EXPECT_EQ(found.image_folder, "rgb/1x");
  EXPECT_EQ(found.resampled_views, 0);
  EXPECT_NEAR(found.camera_turn_degrees, 90, 1e-4);
  EXPECT_NEAR(found.field_of_view_degrees, 61.9275, 1e-3);  // 2·atan(6/10)
  EXPECT_NEAR(found.camera_high.x, 0.3, 1e-6);
  EXPECT_NEAR(found.points_low.z, -0.5, 1e-6);
  EXPECT_NEAR(found.points_high.z, 1.5, 1e-6);
  EXPECT_EQ(found.pixels.views, 8);
  EXPECT_NEAR(found.pixels.masked, 0.25, 1e-9);
  EXPECT_NEAR(found.pixels.with_prior, 0.75, 1e-9);
  EXPECT_TRUE(found.missing.empty()) << found.missing.front();
}

TEST(Inspect, tells_what_is_missing_and_what_looks_wrong) {
  InterpCapture fake(1);
  fake.scene.erase("near");
  fake.scene.erase("far");
  fake.write_image("rgb/1x/000000.png", Tensor<uint8_t>({8, 12, 3}));
  Tensor<uint8_t> mask({8, 12});
  mask.fill(255);
  fake.write_image("mask/1x/000000.png.png", mask);
  fake.save();
  const Inspection found = inspect(load_capture(fake.path(), {}));
  EXPECT_TRUE(names(found.missing, "points"));
  EXPECT_TRUE(names(found.missing, "normal priors"));
  EXPECT_TRUE(names(found.missing, "test views"));
  EXPECT_TRUE(names(found.missing, "near and far"));
  EXPECT_TRUE(names(found.findings, "of one colour"));
  EXPECT_TRUE(names(found.findings, "the other way round"));
  EXPECT_TRUE(names(found.findings, "cannot move"));
}

TEST(Inspect, broken_images_become_findings) {
  NerfDsCapture fake;
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  const auto path = fake.path() / "rgb/1x/000002_left.png";
  std::filesystem::resize_file(path, std::filesystem::file_size(path) / 2);
  const Inspection found = inspect(capture);
  EXPECT_EQ(found.pixels.views, 7);
  EXPECT_TRUE(names(found.findings, "000002_left.png"));
}

}  // namespace
}  // namespace traceflow
