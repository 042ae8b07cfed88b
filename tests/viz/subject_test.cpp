#include "viz/subject.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <limits>

#include "splat/ply.h"
#include "viz/layers.h"
#include "viz/moving_subject.h"

namespace traceflow::viz {
namespace {

Camera<float> in_capture(Camera<float> camera, const SceneNormalisation& n) {
  camera.position = Vec3<float>(Vec3<double>(camera.position) / n.scale + n.centre);
  return camera;
}

Frame render(const Subject& subject, const Camera<float>& camera, float time) {
  Renderer renderer(subject.render);
  FrameRequest request = subject.request;
  request.camera = camera;
  request.time = time;
  const Frame& frame = renderer.forward(subject.scene, request);
  Frame copy;
  copy.camera = frame.camera;
  copy.drawn_with = frame.drawn_with;
  copy.main = frame.main;
  copy.colour = frame.colour;
  copy.raster = frame.raster;
  copy.samples = frame.samples;
  copy.traced = frame.traced;
  copy.specular_rays = frame.specular_rays;
  return copy;
}

double mean_difference(const Tensor<float>& a, const Tensor<float>& b) {
  EXPECT_EQ(a.shape(), b.shape());
  double sum = 0;
  for (int64_t i = 0; i < a.size(); ++i) sum += std::abs(double{a[i]} - double{b[i]});
  return sum / static_cast<double>(std::max<int64_t>(1, a.size()));
}

class Export : public testing::Test {
 protected:
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("traceflow-export-" + std::to_string(::getpid()));
};

TEST_F(Export, RoundTripGivesTheSamePictures) {
  const Subject subject = moving_subject();
  const Frame direct = render(subject, camera_in_scene(), 0.5F);
  EXPECT_FALSE(direct.traced.pixel.empty());
  EXPECT_GT(mean_difference(direct.colour, render(subject, camera_in_scene(), 0).colour), 1e-3)
      << "the scene moves";

  const std::vector<std::filesystem::path> files = export_subject(subject, 0.5F, folder_);
  ASSERT_EQ(files.size(), 2U);
  const Subject back = read_splat_subject(files[0], {});
  EXPECT_EQ(back.warning, "");
  const Frame again = render(back, in_capture(camera_in_scene(), subject.scene.normalisation), 0);
  for (size_t i = 0; i < layer_names.size(); ++i) {
    const auto layer = static_cast<Layer>(i);
    const Tensor<float> a = layer_values(direct, layer, subject.scene.normalisation.scale);
    EXPECT_LT(mean_difference(a, layer_values(again, layer, 1)), 2e-4) << layer_names[i];
  }
}

TEST_F(Export, WithoutTimeIsUndeformed) {
  Subject subject = moving_subject();
  const Subject back = read_splat_subject(export_subject(subject, std::nullopt, folder_)[0], {});
  subject.request.deform_main = subject.request.deform_environment = false;
  const Frame direct = render(subject, camera_in_scene(), 0.5F);
  const Frame again = render(back, in_capture(camera_in_scene(), subject.scene.normalisation), 0.5F);
  EXPECT_LT(mean_difference(direct.colour, again.colour), 2e-4);
}

TEST_F(Export, LeavesOutWhatTheRunHasNotReached) {
  Subject subject = moving_subject();
  subject.request.specular = false;
  EXPECT_EQ(export_subject(subject, 0.5F, folder_).size(), 1U);
  EXPECT_EQ(read_splat_subject(folder_ / "main.ply", {}).scene.specular, Specular::none);
}

TEST_F(Export, LeavesOutSurfelsThatAreNotFinite) {
  Subject subject = moving_subject();
  subject.scene.main.log_scale(7, 1) = std::numeric_limits<float>::quiet_NaN();
  export_subject(subject, 0.5F, folder_);
  const Subject back = read_splat_subject(folder_ / "main.ply", {});
  EXPECT_EQ(back.scene.main.count(), subject.scene.main.count() - 1);
}

TEST_F(Export, AMissingEnvironmentIsAWarning) {
  export_subject(moving_subject(), 0.5F, folder_);
  std::filesystem::remove(folder_ / "environment.ply");
  const Subject back = read_splat_subject(folder_ / "main.ply", {});
  EXPECT_THAT(back.warning, testing::HasSubstr("environment.ply"));
  EXPECT_EQ(render(back, camera_in_scene(), 0).traced.pixel.size(), 0);
}

TEST_F(Export, NotesFromAHostileFileAreRefused) {
  std::filesystem::create_directories(folder_);
  Random random(1);
  const Surfels surfels = random_surfels(3, 1, true, random);
  const std::vector<std::pair<std::string, std::string>> cases = {{"extent", "-1"},
                                                                  {"focal", "0"},
                                                                  {"extent", "nan"},
                                                                  {"extent", "1x"},
                                                                  {"environment", "../other.ply"},
                                                                  {"environment", ".."},
                                                                  {"render", "no json"},
                                                                  {"environment", "/etc/passwd"},
                                                                  {"render", R"({"depth_ratio": 7})"},
                                                                  {"render", R"({"unknown": 1})"}};
  for (const auto& [key, value] : cases) {
    write_ply(folder_ / "a.ply", {surfels, {{key, value}}});
    EXPECT_THROW(read_splat_subject(folder_ / "a.ply", {}), InputError) << key << " " << value;
  }
}

TEST(Extent, IsTheMedianDistanceFromTheCameras) {
  Random random(2);
  Surfels surfels = random_surfels(5, 0, false, random);
  for (int64_t i = 0; i < 5; ++i) surfels.position(i, 2) = static_cast<float>(i);
  surfels.position(4, 0) = std::numeric_limits<float>::quiet_NaN();
  Camera<float> left, right;
  left.position = {-1, 0, -2};
  right.position = {1, 0, -2};
  EXPECT_EQ(extent_seen_from(surfels, {{"l", {}, left}, {"r", {}, right}}), 4);
  EXPECT_EQ(extent_seen_from(Surfels{}, {{"l", {}, left}}), 1);
}

}  // namespace
}  // namespace traceflow::viz
