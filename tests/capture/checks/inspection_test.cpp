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

// A wall of points, and depths that are right, of another scale in one view, or wrong everywhere.
TEST(Inspect, judges_depth_priors_by_the_points) {
  NerfDsCapture fake(8);
  Tensor<float> points({1600, 3});
  for (int64_t i = 0; i < 1600; ++i) {
    points(i, 0) = 0.1F * static_cast<float>(i % 40) - 2;
    points(i, 1) = 0.1F * static_cast<float>(i / 40) - 2;
    points(i, 2) = 6;
  }
  write_npy(fake.path() / "points.npy", points);
  fake.save();
  const auto with = [&](const std::function<float(int view)>& factor) {
    const Capture capture = load_capture(fake.path(), {});
    std::filesystem::create_directories(fake.path() / "depth/1x");
    for (int v = 0; v < 8; ++v) {
      Tensor<float> depth({8, 12});
      const View& view = capture.train[static_cast<size_t>(v)];
      const double scale = capture.normalisation.scale;
      const Vec3<float> wall(capture.normalisation.in_scene({0, 0, 6}));
      depth.fill(factor(v) * static_cast<float>(view.camera.point_in_camera(wall).z / scale));
      write_npy(fake.path() / "depth/1x" / (view.id + ".npy"), depth);
    }
    return inspect(load_capture(fake.path(), {}));
  };
  const auto is_about = [](const Finding& finding) { return finding.kind == "depth-disagrees"; };
  const Inspection right = with([](int) { return 1.02F; });
  EXPECT_EQ(right.train.depth_priors, 8);
  EXPECT_EQ(right.pixels.with_depth, 1);
  EXPECT_NEAR(right.pixels.depth_error, 0.02, 1e-3);
  EXPECT_NEAR(right.pixels.depth_drift, 0, 1e-3);
  EXPECT_FALSE(std::ranges::any_of(right.findings, is_about));
  const Inspection odd =
      with([](int view) { return view == 3 ? 1.5F : 1 + 0.01F * static_cast<float>(view); });
  EXPECT_GT(odd.pixels.depth_drift, 0.01);
  const auto finding = std::ranges::find_if(odd.findings, is_about);
  ASSERT_NE(finding, odd.findings.end());
  EXPECT_EQ(finding->views.size(), 1U);
  EXPECT_NEAR(*finding->value, 0.5, 1e-3);
  const Inspection wrong = with([](int) { return 2.0F; });
  EXPECT_TRUE(std::ranges::any_of(wrong.findings, is_about));
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
