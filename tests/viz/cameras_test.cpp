#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <numbers>

#include "support/refusal.h"
#include "viz/cameras/camera_file.h"
#include "viz/cameras/orbit.h"

namespace traceflow::viz {
namespace {

using testing::HasSubstr;

class CameraFile : public testing::Test {
 protected:
  void TearDown() override { std::filesystem::remove(file_); }
  void write(const std::string& text) const { std::ofstream(file_) << text; }
  std::string refusal() const {
    return refusal_of([&] { read_cameras(file_, {}); });
  }
  std::filesystem::path file_ =
      std::filesystem::temp_directory_path() / ("traceflow-cameras-" + std::to_string(::getpid()) + ".json");
};

// A camera turned by 90° about the world's y: its forward axis (third column of world_from_camera) is the
// world's x.
const std::string turned_camera =
    R"({"id": 4, "img_name": "b/view", "width": 64, "height": 48, "position": [1, 2, 3],
  "rotation": [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], "fx": 50, "fy": 60})";

std::string with(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST_F(CameraFile, RotationIsWorldFromCamera) {
  write("[" + turned_camera + "]");
  const Shot shot = read_cameras(file_, {})[0];
  EXPECT_EQ(shot.name, "b/view");
  EXPECT_FALSE(shot.time.has_value());
  EXPECT_EQ(shot.camera.width, 64);
  EXPECT_EQ(shot.camera.centre_x, 32);
  EXPECT_EQ(shot.camera.centre_y, 24);
  // The middle pixel looks along the world's x from (1, 2, 3).
  const Vec3<float> ray = shot.camera.ray_in_world(32, 24);
  EXPECT_NEAR(ray.x, 1, 1e-6);
  EXPECT_NEAR(ray.y, 0, 1e-6);
  EXPECT_NEAR(ray.z, 0, 1e-6);
  const Vec2<float> pixel = shot.camera.project(shot.camera.point_in_camera({3, 2.5F, 3}));
  EXPECT_NEAR(pixel.x, 32, 1e-4);
  EXPECT_NEAR(pixel.y, 24 + 60 * 0.5 / 2, 1e-4);
}

TEST_F(CameraFile, OptionalFieldsAndNormalisation) {
  write("[" + with(turned_camera, "\"fx\"", "\"cx\": 30.5, \"cy\": 20, \"time\": 0.25, \"fx\"") + "]");
  const Shot shot = read_cameras(file_, {{1, 1, 1}, 0.5})[0];
  EXPECT_EQ(shot.camera.centre_x, 30.5F);
  EXPECT_EQ(shot.camera.centre_y, 20);
  EXPECT_EQ(*shot.time, 0.25F);
  EXPECT_EQ(shot.camera.position, (Vec3<float>{0, 0.5F, 1}));
}

TEST_F(CameraFile, NamesFallBackToIdAndPlace) {
  write("[" + with(turned_camera, "\"img_name\": \"b/view\",", "") + "," +
        with(turned_camera, "\"id\": 4, \"img_name\": \"b/view\",", "") + "]");
  const std::vector<Shot> shots = read_cameras(file_, {});
  EXPECT_EQ(shots[0].name, "4");
  EXPECT_EQ(shots[1].name, "00001");
}

// 3DGS and 2DGS list test and training views of NeRF-synthetic scenes together, by the stems of their files.
TEST_F(CameraFile, NamesThatComeAgainGetTheirIdsOrPlaces) {
  const auto camera = [](const std::string& head) {
    return with(turned_camera, "\"id\": 4, \"img_name\": \"b/view\",", head);
  };
  write("[" + camera("\"id\": 0, \"img_name\": \"r_0\",") + "," +
        camera("\"id\": 1, \"img_name\": \"r_1\",") + "," + camera("\"id\": 200, \"img_name\": \"r_0\",") +
        "," + camera("\"img_name\": \"r_0\",") + "," + camera("\"id\": \"left\", \"img_name\": \"r_0\",") +
        "," + camera("\"id\": 5, \"img_name\": \"r_0_200\",") + "]");
  std::vector<std::string> names;
  for (const Shot& shot : read_cameras(file_, {})) names.push_back(shot.name);
  EXPECT_THAT(names, testing::ElementsAre("r_0", "r_1", "r_0_200", "r_0_00003", "r_0_left", "r_0_200_5"));
}

TEST_F(CameraFile, BadInputIsRefusedByName) {
  const std::string nameless = with(turned_camera, "\"img_name\": \"b/view\",", "");
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", "not JSON"},
      {"{}", "list of cameras"},
      {"[]", "at least one"},
      {"[3]", "[0]: found 3, expected an object"},
      {std::string(100000, '['), "64 deep"},
      {"[" + nameless + "," + nameless + "]", "[1]: found 4 a second time, expected names that differ"},
      {"[" + turned_camera + "," + turned_camera + "," + turned_camera + "]", "[2]: found b/view_4 a second"},
      {"[" + turned_camera + "," + with(turned_camera, "4", "\"../../view\"") + "]", "[1].img_name"},
      {"[" + turned_camera + "," + with(turned_camera, "4", "4.5") + "]", "[1].id"},
      {"[" + with(turned_camera, "\"fx\": 50,", "") + "]", "fx"},
      {"[" + with(turned_camera, "\"fx\": 50", "\"fx\": 0") + "]", "fx"},
      {"[" + with(turned_camera, "\"fx\": 50", "\"fx\": \"50\"") + "]", "fx"},
      // Single precision would make infinity and nothing of these.
      {"[" + with(turned_camera, "\"fx\": 50", "\"fx\": 1e40") + "]", "fx"},
      {"[" + with(turned_camera, "\"fx\": 50", "\"fx\": 1e-50") + "]", "fx"},
      {"[" + with(turned_camera, "\"fx\"", "\"cx\": 1e40, \"cy\": 20, \"fx\"") + "]", "cx"},
      {"[" + with(turned_camera, "\"fx\": 50", "\"fx\": 1e400") + "]", ""},
      {"[" + with(turned_camera, "64", "0") + "]", "width"},
      {"[" + with(turned_camera, "64", "64.5") + "]", "width"},
      {"[" + with(turned_camera, "64", "1e12") + "]", "width"},
      {"[" + with(turned_camera, "[1, 2, 3]", "[1, 2]") + "]", "position"},
      {"[" + with(turned_camera, "[1, 2, 3]", "[1, 2, null]") + "]", "position"},
      {"[" + with(turned_camera, "[0, 1, 0]", "[0, 2, 0]") + "]", "rotation"},
      {"[" + with(turned_camera, "[0, 1, 0]", "[0, -1, 0]") + "]", "rotation"},
      {"[" + with(turned_camera, "\"fx\"", "\"time\": 1.5, \"fx\"") + "]", "time"},
      {"[" + with(turned_camera, "b/view", "../view") + "]", "img_name"},
      {"[" + with(turned_camera, "b/view", "/etc/view") + "]", "img_name"},
      {"[" + with(turned_camera, "b/view", "a/../../view") + "]", "img_name"},
      {"[" + with(turned_camera, "b/view", "") + "]", "img_name"},
      {"[" + with(turned_camera, "\"b/view\"", "7") + "]", "img_name"},
  };
  for (const auto& [text, field] : cases) {
    write(text);
    const std::string message = refusal();
    EXPECT_NE(message, "accepted") << text.substr(0, 300);
    EXPECT_THAT(message, HasSubstr(field)) << text.substr(0, 300);
    EXPECT_EQ(message.find('\n'), std::string::npos);
  }
}

Camera<float> looking_at_origin(double angle, float radius, float above) {
  const Vec3<double> position(radius * std::sin(angle), -above, -radius * std::cos(angle));
  const Vec3<double> z = normalize(-position);
  const Vec3<double> x = normalize(cross(z, Vec3<double>(0, -1, 0)));
  Camera<float> camera;
  camera.width = 40;
  camera.height = 30;
  camera.focal_x = camera.focal_y = 35;
  camera.centre_x = 20;
  camera.centre_y = 15;
  camera.position = Vec3<float>(position);
  camera.camera_from_world = Mat3<float>(transpose(Mat3<double>(x, cross(z, x), z)));
  return camera;
}

void expect_good_frame(const Camera<float>& camera, const Vec3<float>& target) {
  const Mat3<float>& r = camera.camera_from_world;
  EXPECT_NEAR(determinant(r), 1, 1e-5);
  const Vec3<float> seen = camera.point_in_camera(target);
  EXPECT_GT(seen.z, 0);
  EXPECT_NEAR(camera.project(seen).x, camera.centre_x, 0.05);
  EXPECT_NEAR(camera.project(seen).y, camera.centre_y, 0.05);
}

TEST(Orbit, KeepsToTheAngleTheCamerasSpan) {
  std::vector<Camera<float>> cameras;
  for (int i = -4; i <= 4; ++i) cameras.push_back(looking_at_origin(0.1 * i, 3, 1));
  const std::vector<Shot> shots = orbit_around_cameras(cameras, 24);
  ASSERT_EQ(shots.size(), 24U);
  EXPECT_EQ(shots[7].name, "00007");
  double widest = 0;
  for (const Shot& shot : shots) {
    expect_good_frame(shot.camera, Vec3<float>(0));
    EXPECT_NEAR(glm::length(shot.camera.position), std::sqrt(10), 0.05);
    EXPECT_LT(shot.camera.camera_from_world[1][1] - 1, 1e-6);
    EXPECT_GT(shot.camera.camera_from_world[1][1], 0) << "the world's y stays down";
    widest = std::max(widest,
                      std::abs(std::atan2(double{shot.camera.position.x}, -double{shot.camera.position.z})));
  }
  EXPECT_NEAR(widest, 0.4, 0.02);
}

TEST(Orbit, GoesRoundWhereTheCamerasDo) {
  std::vector<Camera<float>> cameras;
  cameras.reserve(12);
  for (int i = 0; i < 12; ++i) cameras.push_back(looking_at_origin(2 * std::numbers::pi * i / 12, 3, 1));
  Vec3<float> sum(0);
  for (const Shot& shot : orbit_around_cameras(cameras, 36)) {
    expect_good_frame(shot.camera, Vec3<float>(0));
    sum += shot.camera.position;
  }
  EXPECT_NEAR(sum.x / 36, 0, 1e-4);
  EXPECT_NEAR(sum.z / 36, 0, 1e-4);
}

TEST(Orbit, OfOneCameraOrParallelOnesLooksAhead) {
  const Camera<float> one = looking_at_origin(0.3, 2, 0);
  for (const std::vector<Camera<float>>& cameras : {std::vector{one}, std::vector{one, one, one}}) {
    for (const Shot& shot : orbit_around_cameras(cameras, 8)) {
      for (int axis = 0; axis < 3; ++axis) EXPECT_TRUE(std::isfinite(shot.camera.position[axis]));
      EXPECT_GT(dot(shot.camera.ray_in_world(20, 15), one.ray_in_world(20, 15)), 0.9F);
    }
  }
}

TEST(Orbit, AroundPointsSeesTheirMiddle) {
  Tensor<float> points(Shape{101, 3});
  for (int64_t i = 0; i < 100; ++i) {
    points(i, 0) = 5 + static_cast<float>(std::cos(0.3 * static_cast<double>(i)));
    points(i, 1) = -2 + 0.01F * static_cast<float>(i - 50);
    points(i, 2) = 1 + static_cast<float>(std::sin(0.3 * static_cast<double>(i)));
  }
  points(100, 0) = std::numeric_limits<float>::infinity();
  for (const Shot& shot : orbit_around_points(points, 64, 48, 10)) {
    const Vec2<float> pixel = shot.camera.project(shot.camera.point_in_camera({5, -2, 1}));
    EXPECT_NEAR(pixel.x, 32, 5);
    EXPECT_NEAR(pixel.y, 24, 5);
  }
  EXPECT_EQ(orbit_around_points({}, 64, 48, 3).size(), 3U);
}

}  // namespace
}  // namespace traceflow::viz
