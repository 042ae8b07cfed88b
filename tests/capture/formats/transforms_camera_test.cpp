#include "capture/formats/transforms/transforms_camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"

namespace traceflow {
namespace {

using testing::HasSubstr;

Lens lens_of(const std::string& common, const std::string& frame = "{}") {
  const JsonDocument all("transforms.json", common), one("transforms.json", frame);
  TransformsLens lens;
  lens.take(all);
  lens.take(one);
  return lens.lens(80, 60, one);
}

TEST(TransformsLens, an_angle_gives_the_focal_length_and_the_image_the_rest) {
  const Lens lens = lens_of(R"({"camera_angle_x": 0.8})");
  EXPECT_NEAR(std::atan(lens.width / 2 / lens.focal.x), 0.4, 1e-12);
  EXPECT_EQ(lens.focal.x, lens.focal.y);
  EXPECT_EQ(lens.centre, Vec2<double>(40, 30));
  EXPECT_EQ(Vec2<double>(lens.width, lens.height), Vec2<double>(80, 60));
  EXPECT_TRUE(lens.is_pinhole());
}

// The names, in an order that no formula would hide.
TEST(TransformsLens, all_fields_and_a_frame_over_its_file) {
  const std::string common =
      R"({"w": 160, "h": 120, "fl_x": 100, "fl_y": 110, "cx": 81, "cy": 59, "camera_angle_x": 3,
      "k1": 0.1, "k2": 0.2, "k3": 0.3, "k4": 0.4, "p1": 0.5, "p2": 0.6, "aabb_scale": 16})";
  const Lens lens = lens_of(common);
  EXPECT_EQ(Vec2<double>(lens.width, lens.height), Vec2<double>(160, 120));
  EXPECT_EQ(lens.focal, Vec2<double>(100, 110));
  EXPECT_EQ(lens.centre, Vec2<double>(81, 59));
  EXPECT_EQ(lens.radial, Vec3<double>(0.1, 0.2, 0.3));
  EXPECT_EQ(lens.radial_4, 0.4);
  EXPECT_EQ(lens.tangential, Vec2<double>(0.5, 0.6));
  EXPECT_EQ(lens.projection, Projection::perspective);
  EXPECT_EQ(lens_of(common, R"({"fl_x": 99, "k2": 0})").focal, Vec2<double>(99, 110));
  EXPECT_EQ(lens_of(common, R"({"fl_x": 99, "k2": 0})").radial.y, 0);
}

TEST(TransformsLens, each_side_has_its_angle_and_lengths_count_more) {
  const double x = 40 / std::tan(0.4), y = 30 / std::tan(0.2);
  const auto expect = [](const Lens& lens, double focal_x, double focal_y) {
    EXPECT_NEAR(lens.focal.x, focal_x, 1e-9);
    EXPECT_NEAR(lens.focal.y, focal_y, 1e-9);
  };
  expect(lens_of(R"({"camera_angle_x": 0.8, "camera_angle_y": 0.4})"), x, y);
  expect(lens_of(R"({"camera_angle_y": 0.4})"), y, y);
  expect(lens_of(R"({"fl_x": 50, "camera_angle_y": 0.4})"), 50, 50);
  expect(lens_of(R"({"camera_angle_x": 0.8, "fl_y": 50})"), x, 50);
}

TEST(TransformsLens, a_frames_angle_counts_more_than_its_files_lengths) {
  const double x = 40 / std::tan(0.4);
  const char* file = R"({"fl_x": 100, "fl_y": 110, "camera_angle_y": 1})";
  EXPECT_NEAR(lens_of(file, R"({"camera_angle_x": 0.8})").focal.x, x, 1e-9);
  EXPECT_NEAR(lens_of(file, R"({"camera_angle_x": 0.8})").focal.y, x, 1e-9);
  EXPECT_EQ(lens_of(file, R"({"camera_angle_x": 0.8, "fl_x": 90})").focal, Vec2<double>(90));
}

TEST(TransformsLens, instant_ngps_angles_are_degrees) {
  // 0.8 and 0.4 radians.
  const std::string x_fov = R"("x_fov": 45.83662361046586)", y_fov = R"("y_fov": 22.91831180523293)";
  const double x = 40 / std::tan(0.4), y = 30 / std::tan(0.2);
  const auto expect = [](const Lens& lens, double focal_x, double focal_y) {
    EXPECT_NEAR(lens.focal.x, focal_x, 1e-9);
    EXPECT_NEAR(lens.focal.y, focal_y, 1e-9);
  };
  expect(lens_of("{" + x_fov + "}"), x, x);
  expect(lens_of("{" + y_fov + "}"), y, y);
  expect(lens_of("{" + x_fov + ", " + y_fov + "}"), x, y);
  // Degrees count more than radians, lengths more than angles, and a frame's angle more than its file says.
  expect(lens_of("{" + x_fov + R"(, "camera_angle_x": 2, "camera_angle_y": 0.4})"), x, y);
  expect(lens_of("{" + x_fov + R"(, "fl_x": 50})"), 50, 50);
  expect(lens_of(R"({"fl_x": 50, "fl_y": 60})", "{" + x_fov + "}"), x, x);
  expect(lens_of("{" + y_fov + "}", R"({"camera_angle_x": 0.8})"), x, x);
}

TEST(TransformsLens, other_lenses_that_are_switched_off_leave_a_pinhole) {
  for (const char* off :
       {R"("latlong": false)", R"("equirectangular": false, "orthographic": false)", R"("latlong": null)",
        R"("equirectangular": 0)", R"("distortion_params": [0, 0.0, 0, 0, 0, 0])",
        R"("distortion_params": [])", R"("ftheta_p0": 0, "ftheta_p1": 0.0)"}) {
    const Lens lens = lens_of(R"({"fl_x": 50, )" + std::string(off) + "}");
    EXPECT_TRUE(lens.is_pinhole()) << off;
    EXPECT_EQ(lens.focal, Vec2<double>(50)) << off;
  }
}

TEST(TransformsLens, fisheyes_and_matrices) {
  const Lens fisheye = lens_of(R"({"fl_x": 50, "k1": 0.1, "p1": 1, "camera_model": "OPENCV_FISHEYE"})");
  EXPECT_EQ(fisheye.projection, Projection::equidistant);
  EXPECT_EQ(fisheye.tangential, Vec2<double>(0));
  EXPECT_EQ(lens_of(R"({"fl_x": 50, "is_fisheye": true})").projection, Projection::equidistant);
  EXPECT_TRUE(lens_of(R"({"fl_x": 50, "camera_model": "OPENCV"})").is_pinhole());
  EXPECT_EQ(lens_of(R"({"fx": 50, "fy": 60})").focal, Vec2<double>(50, 60));
  const Lens k = lens_of("{}", R"({"K": [[50, 0.5, 41], [0, 52, 31], [0, 0, 1]]})");
  EXPECT_EQ(k.focal, Vec2<double>(50, 52));
  EXPECT_EQ(k.centre, Vec2<double>(41, 31));
  EXPECT_EQ(k.skew, 0.5);
}

TEST(TransformsLensHostile, each_is_refused_by_name) {
  const std::pair<const char*, const char*> cases[] = {
      {R"({})", "no focal length"},
      {R"({"fl_x": 0})", "fl_x: found 0"},
      {R"({"fl_x": "5"})", "fl_x"},
      {R"({"fl_x": 1e300})", "fl_x"},
      {R"({"camera_angle_x": 3.2})", "camera_angle_x: found 3.2"},
      {R"({"fl_x": 5, "w": -1})", "w: found -1"},
      {R"({"fl_x": 5, "k1": null, "k2": [1]})", "k2: found [1]"},
      {R"({"fl_x": 5, "camera_model": "EQUIRECTANGULAR"})", "camera_model: found EQUIRECTANGULAR"},
      {R"({"fl_x": 5, "camera_model": 3})", "camera_model: found 3"},
      {R"({"x_fov": 0})", "x_fov: found 0"},
      {R"({"y_fov": 180})", "y_fov: found 180, expected an angle below 180°"},
      {R"({"fl_x": 5, "x_fov": "wide"})", "x_fov: found \"wide\""},
      {R"({"fl_x": 5, "ftheta_p0": 0, "ftheta_p1": 0.001})",
       "ftheta_p1: found an f-theta lens, expected OPENCV, OPENCV_FISHEYE, PINHOLE or a simpler model of "
       "these; "
       "undistort the images"},
      {R"({"fl_x": 5, "ftheta_p4": 1e-9})", "ftheta_p4: found an f-theta lens"},
      {R"({"fl_x": 5, "latlong": true})", "latlong: found a panorama"},
      {R"({"fl_x": 5, "equirectangular": 1})", "equirectangular: found a panorama"},
      {R"({"fl_x": 5, "equirectangular": "yes"})", "equirectangular: found a panorama"},
      {R"({"fl_x": 5, "orthographic": true})", "orthographic: found an orthographic camera"},
      {R"({"fl_x": 5, "distortion_params": [0, 0, 0.1, 0]})",
       "distortion_params: found a list of distortion, expected k1 to k4, p1 and p2"},
      {R"({"K": [[0, 0, 1], [0, 1, 1], [0, 0, 1]]})", "K: found"},
      {R"({"K": [1, 2, 3]})", "K[0]"}};
  for (const auto& [json, expected] : cases) {
    try {
      lens_of(json);
      ADD_FAILURE() << json;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("transforms.json"));
      EXPECT_THAT(error.what(), HasSubstr(expected));
    }
  }
}

TransformsPose pose_of(const std::string& matrix) {
  const JsonDocument json("transforms.json", "{\"transform_matrix\": " + matrix + "}");
  return read_transform_matrix(json["transform_matrix"]);
}

TEST(TransformsPose, axes_of_opengl_become_ours) {
  // A camera at (1, 2, 3) that looks along the world's −z with the world's y up: OpenGL's rest.
  const TransformsPose pose = pose_of("[[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]");
  EXPECT_EQ(pose.position, Vec3<double>(1, 2, 3));
  EXPECT_EQ(pose.camera_from_world * Vec3<double>(0, 0, -1), Vec3<double>(0, 0, 1));
  EXPECT_EQ(pose.camera_from_world * Vec3<double>(0, 1, 0), Vec3<double>(0, -1, 0));
  EXPECT_EQ(pose.camera_from_world * Vec3<double>(1, 0, 0), Vec3<double>(1, 0, 0));
  // Turned a quarter about z, twice as large, few digits, without a last row.
  const TransformsPose turned = pose_of("[[0,-2.001,0,1],[2,0,0,2],[0,0.001,2,3]]");
  EXPECT_LT(length(turned.camera_from_world * Vec3<double>(0, 1, 0) - Vec3<double>(1, 0, 0)), 1e-3);
  const Mat3<double> error = turned.camera_from_world * transpose(turned.camera_from_world) - Mat3<double>(1);
  for (int i = 0; i < 9; ++i) EXPECT_LT(std::abs(error[i / 3][i % 3]), 1e-12);
}

TEST(TransformsPoseHostile, each_is_refused_by_name) {
  for (const char* matrix :
       {"[]", "3", "[[1,0,0,0],[0,1,0,0]]", "[[1,0,0],[0,1,0],[0,0,1]]",
        "[[1,0,0,0],[0,1,0,0],[0,0,0,0],[0,0,0,1]]", "[[1,0,0,0],[0,1,0,0],[0,0,-1,0],[0,0,0,1]]",
        "[[1,0.2,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]", "[[1,0,0,\"x\"],[0,1,0,0],[0,0,1,0]]",
        "[[1e200,0,0,0],[0,1e200,0,0],[0,0,1e200,0]]", "[[0,0,0,0],[0,0,0,0],[0,0,0,0]]",
        "[[1,0,0,1e300],[0,1,0,0],[0,0,1,0]]"}) {
    try {
      pose_of(matrix);
      ADD_FAILURE() << matrix;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("transforms.json: transform_matrix"));
    }
  }
}

}  // namespace
}  // namespace traceflow
