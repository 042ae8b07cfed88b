#include "viz/cameras/camera_path.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/error.h"
#include "math/rotation.h"
#include "viz/cameras/path_curve.h"

namespace traceflow::viz {
namespace {

using Json = nlohmann::json;
using V = Vec3<double>;

double number(double low, double high) { return low + (high - low) * *rc::gen::inRange(0, 10001) / 10000.0; }

Keyframe any_keyframe() {
  Keyframe key;
  key.position = {number(-3, 3), number(-3, 3), number(-3, 3)};
  key.world_from_camera =
      rotation_from_quaternion(Vec4<double>(number(0.1, 1), number(-1, 1), number(-1, 1), number(-1, 1)));
  key.fov_y = number(20, 90);
  key.time = number(0, 1);
  key.seconds = number(0.2, 3);
  return key;
}

CameraPath any_path(int fewest) {
  CameraPath path;
  path.closed = *rc::gen::arbitrary<bool>();
  const int count = *rc::gen::inRange(fewest, 7);
  for (int i = 0; i < count; ++i) path.keyframes.push_back(any_keyframe());
  return path;
}

double difference(const Mat3<double>& a, const Mat3<double>& b) {
  double most = 0;
  for (int i = 0; i < 3; ++i) most = std::max(most, length(a[i] - b[i]));
  return most;
}

// The largest of the differences in position, rotation, fov (radians) and time.
double difference(const Pose& a, const Pose& b) {
  return std::max({length(a.position - b.position), difference(a.world_from_camera, b.world_from_camera),
                   std::abs(a.fov_y - b.fov_y) / 57, std::abs(a.time - b.time)});
}

RC_GTEST_PROP(CameraPath, goes_through_its_keyframes, ()) {
  const CameraPath path = any_path(1);
  const PathCurve curve(path);
  double seconds = 0;
  for (const Keyframe& key : path.keyframes) {
    RC_ASSERT(difference(curve.at(seconds), key) < 1e-6);
    seconds += key.seconds;
  }
  if (path.closed) RC_ASSERT(difference(curve.at(seconds), path.keyframes.front()) < 1e-6);
}

RC_GTEST_PROP(CameraPath, rotations_stay_rotations_and_numbers_between_their_keyframes, ()) {
  const CameraPath path = any_path(2);
  const PathCurve curve(path);
  const double t = number(0, 1) * curve.duration();
  const Pose pose = curve.at(t);
  RC_ASSERT(difference(pose.world_from_camera * transpose(pose.world_from_camera), Mat3<double>(1)) < 1e-9);
  RC_ASSERT(determinant(pose.world_from_camera) > 0);
  size_t i = 0;
  for (double end = path.keyframes[0].seconds;
       end < t && i + 2 < path.keyframes.size() + (path.closed ? 1 : 0); end += path.keyframes[i].seconds) {
    ++i;
  }
  const Keyframe &a = path.keyframes[i], &b = path.keyframes[(i + 1) % path.keyframes.size()];
  RC_ASSERT(pose.fov_y >= std::min(a.fov_y, b.fov_y) - 1e-9 &&
            pose.fov_y <= std::max(a.fov_y, b.fov_y) + 1e-9);
  RC_ASSERT(pose.time >= std::min(a.time, b.time) - 1e-9 && pose.time <= std::max(a.time, b.time) + 1e-9);
}

RC_GTEST_PROP(CameraPath, stands_still_between_equal_keyframes, ()) {
  CameraPath path = any_path(2);
  const size_t i = *rc::gen::inRange<size_t>(1, path.keyframes.size());
  const double seconds = path.keyframes[i].seconds;
  path.keyframes[i] = path.keyframes[i - 1];
  path.keyframes[i].seconds = seconds;
  const PathCurve curve(path);
  double start = 0;
  for (size_t k = 0; k + 1 < i; ++k) start += path.keyframes[k].seconds;
  const Pose pose = curve.at(start + number(0, 1) * path.keyframes[i - 1].seconds);
  RC_ASSERT(difference(pose, path.keyframes[i]) < 1e-6);
}

RC_GTEST_PROP(CameraPath, keyframes_reversed_give_the_motion_reversed, ()) {
  CameraPath path = any_path(1);
  const PathCurve forwards(path);
  CameraPath back = path;
  const size_t n = path.keyframes.size();
  for (size_t i = 0; i < n; ++i) {
    // A closed path's second keyframe backwards is its last.
    back.keyframes[i] = path.keyframes[path.closed ? (n - i) % n : n - 1 - i];
    const size_t before = path.closed ? (2 * n - i - 1) % n : n >= 2 + i ? n - 2 - i : 0;
    back.keyframes[i].seconds = path.keyframes[before].seconds;
  }
  const PathCurve backwards(back);
  const double t = number(0, 1) * forwards.duration();
  RC_ASSERT(std::abs(forwards.duration() - backwards.duration()) < 1e-9);
  RC_ASSERT(difference(forwards.at(t), backwards.at(forwards.duration() - t)) < 1e-6);
}

// Speed and turning go over continuously at every keyframe, the join of a closed path among them.
RC_GTEST_PROP(CameraPath, has_no_kinks, ()) {
  const CameraPath path = any_path(3);
  const PathCurve curve(path);
  constexpr double h = 1e-6;
  double seconds = path.closed ? 0 : path.keyframes[0].seconds;
  for (size_t i = path.closed ? 0 : 1; i + 1 < path.keyframes.size(); ++i) {
    const double before = i == 0 ? curve.duration() : seconds;
    const Pose a = curve.at(before - h), b = curve.at(seconds), c = curve.at(seconds + h);
    RC_ASSERT(length((b.position - a.position) - (c.position - b.position)) / h < 0.02);
    RC_ASSERT(
        difference(b.world_from_camera - a.world_from_camera, c.world_from_camera - b.world_from_camera) / h <
        0.02);
    RC_ASSERT(std::abs((b.fov_y - a.fov_y) - (c.fov_y - b.fov_y)) / h < 1);
    RC_ASSERT(std::abs((b.time - a.time) - (c.time - b.time)) / h < 0.05);
    seconds += path.keyframes[i].seconds;
  }
}

TEST(CameraPath, TurnsTheShorterWayAtAnEvenSpeedBetweenTwoKeyframes) {
  CameraPath path;
  path.keyframes.resize(2);
  path.keyframes[1].position = {2, 0, 0};
  // The other way would be 3.28.
  for (const double angle : {3.0, -3.0}) {
    path.keyframes[1].world_from_camera =
        Mat3<double>(std::cos(angle), 0, -std::sin(angle), 0, 1, 0, std::sin(angle), 0, std::cos(angle));
    const PathCurve curve(path);
    for (const double t : {0.25, 0.5, 0.75}) {
      const Pose pose = curve.at(t);
      EXPECT_NEAR(pose.world_from_camera[0][0], std::cos(t * angle), 1e-9);
      EXPECT_NEAR(pose.world_from_camera[2][0], std::sin(t * angle), 1e-9);
      EXPECT_NEAR(pose.position.x, 2 * t, 1e-9);
    }
  }
}

TEST(CameraPath, FramesBeginAndEndAtTheKeyframesAndAClosedPathDoesNotRepeatTheFirst) {
  CameraPath path;
  path.keyframes.resize(3);
  path.keyframes[1].position = {1, 0, 0};
  path.keyframes[2].position = {1, 1, 0};
  path.fps = 10;
  const auto open = frames_of(path);
  ASSERT_EQ(open.size(), 21U);
  EXPECT_LT(difference(open[10], path.keyframes[1]), 1e-9);
  EXPECT_LT(difference(open.back(), path.keyframes[2]), 1e-9);
  path.closed = true;
  const auto closed = frames_of(path);
  ASSERT_EQ(closed.size(), 30U);
  EXPECT_LT(difference(closed[20], path.keyframes[2]), 1e-9);
  EXPECT_GT(difference(closed.back(), path.keyframes[0]), 0.01);
  path.keyframes.resize(1);
  EXPECT_EQ(frames_of(path).size(), 10U);
  path.closed = false;
  EXPECT_EQ(frames_of(path).size(), 1U);
}

TEST(CameraPath, ShotsAreCamerasOfTheScene) {
  CameraPath path;
  path.width = 200;
  path.height = 100;
  path.keyframes.resize(1);
  path.keyframes[0].position = {3, 1, 1};
  path.keyframes[0].fov_y = 90;
  path.keyframes[0].time = 0.25;
  path.keyframes[0].world_from_camera = Mat3<double>(0, 1, 0, -1, 0, 0, 0, 0, 1);
  const auto shots = shots_of(path, {V(1, 1, 1), 2});
  ASSERT_EQ(shots.size(), 1U);
  const Camera<float>& camera = shots[0].camera;
  EXPECT_EQ(shots[0].name, "00000");
  EXPECT_EQ(shots[0].time, 0.25F);
  EXPECT_NEAR(camera.focal_y, 50, 1e-4);
  EXPECT_NEAR(camera.focal_x, 50, 1e-4);
  EXPECT_EQ(camera.centre_x, 100);
  EXPECT_EQ(camera.centre_y, 50);
  EXPECT_EQ(camera.position, Vec3<float>(4, 0, 0));
  // The camera's x axis is the file's first column.
  EXPECT_EQ(camera.point_in_camera({4, 1, 0}), Vec3<float>(1, 0, 0));
}

Json good_path() {
  return Json::parse(
      R"({"format":"traceflow camera path","version":1,"width":64,"height":48,"fps":10,"closed":false,
    "keyframes":[{"position":[1,2,3],"rotation":[[0,-1,0],[1,0,0],[0,0,1]],"fov_y":45,"time":0.5,"seconds":2},
                 {"position":[1,2,4],"rotation":[[1,0,0],[0,1,0],[0,0,1]],"fov_y":45,"time":0.5,"seconds":0}]})");
}

TEST(CameraPath, ReadsTheViewersJson) {
  const CameraPath path = parse_camera_path(good_path().dump(), "file");
  EXPECT_EQ(path.width, 64);
  ASSERT_EQ(path.keyframes.size(), 2U);
  EXPECT_EQ(path.keyframes[0].position, V(1, 2, 3));
  // Rows of world_from_camera: the camera's x axis in world is the first column.
  EXPECT_EQ(path.keyframes[0].world_from_camera[0], V(0, 1, 0));
  EXPECT_EQ(frame_count(path), 21);
}

TEST(CameraPath, RefusalsNameKeyframeAndField) {
  struct Case {
    const char* pointer;
    const char* value;
    const char* named;
  };
  const Case cases[] = {
      {"/format", R"("cameras")", "format"},
      {"/format", R"([[[]]])", "format"},
      {"/version", "2", "version"},
      {"/version", "null", "version"},
      {"/width", "0", "width"},
      {"/width", "1.5", "width"},
      {"/height", "1e9", "height"},
      {"/height", R"("48")", "height"},
      {"/fps", "0", "fps"},
      {"/fps", "1e300", "fps"},
      {"/closed", "1", "closed"},
      {"/closed", "true", "keyframes[1].seconds"},
      {"/keyframes", "[]", "keyframes"},
      {"/keyframes", "{}", "keyframes"},
      {"/keyframes/1", "7", "keyframes[1]"},
      {"/keyframes/0/position", "[1,2]", "keyframes[0].position"},
      {"/keyframes/0/position", "[1,2,1e40]", "keyframes[0].position"},
      {"/keyframes/0/position", "[1,2,null]", "keyframes[0].position"},
      {"/keyframes/1/rotation", "[[1,0,0],[0,1,0]]", "keyframes[1].rotation"},
      {"/keyframes/1/rotation", "[[1,0,0],[0,1,0],[0,0,-1]]", "keyframes[1].rotation"},
      {"/keyframes/1/rotation", "[[1,0,0],[0,2,0],[0,0,1]]", "keyframes[1].rotation"},
      {"/keyframes/1/rotation", "[[0,0,0],[0,0,0],[0,0,0]]", "keyframes[1].rotation"},
      {"/keyframes/0/fov_y", "180", "keyframes[0].fov_y"},
      {"/keyframes/0/time", "-0.1", "keyframes[0].time"},
      {"/keyframes/0/seconds", "0", "keyframes[0].seconds"},
      {"/keyframes/0/seconds", "-1", "keyframes[0].seconds"},
      {"/keyframes/0/seconds", "100000", "frames"},
  };
  for (const Case& c : cases) {
    Json json = good_path();
    json[Json::json_pointer(c.pointer)] = Json::parse(c.value);
    try {
      parse_camera_path(json.dump(), "film.json");
      ADD_FAILURE() << c.pointer << " " << c.value;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr(c.named)) << c.pointer << " " << c.value;
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    }
  }
  for (const char* key : {"format", "version", "width", "height", "fps", "closed", "keyframes"}) {
    Json json = good_path();
    json.erase(key);
    EXPECT_THROW(parse_camera_path(json.dump(), "f"), InputError) << key;
  }
  for (const char* key : {"position", "rotation", "fov_y", "time", "seconds"}) {
    Json json = good_path();
    json["keyframes"][1].erase(key);
    EXPECT_THROW(parse_camera_path(json.dump(), "f"), InputError) << key;
  }
}

TEST(CameraPath, TextThatIsNoPathIsRefusedBeforeMemoryIsTaken) {
  for (const std::string& text :
       {std::string(), std::string("{"), std::string("[]"), std::string("null"), std::string("\xff\xfe"),
        std::string(1'000'000, '['),
        R"({"format":)" + std::string(500'000, '[') + std::string(500'000, ']') + "}"}) {
    EXPECT_THROW(parse_camera_path(text, "f"), InputError) << text.substr(0, 20);
  }
  Json json = good_path();
  const Json key = json["keyframes"][0];
  for (int i = 0; i < 10'000; ++i) json["keyframes"].push_back(key);
  EXPECT_THROW(parse_camera_path(json.dump(), "f"), InputError);
}

RC_GTEST_PROP(CameraPath, a_path_cut_anywhere_is_refused, ()) {
  const std::string text = good_path().dump();
  const auto cut = *rc::gen::inRange<size_t>(0, text.size());
  RC_ASSERT_THROWS_AS(parse_camera_path(text.substr(0, cut), "f"), InputError);
}

}  // namespace
}  // namespace traceflow::viz
