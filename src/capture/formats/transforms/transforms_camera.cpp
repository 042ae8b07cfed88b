#include "capture/formats/transforms/transforms_camera.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "math/pixel_limits.h"

namespace traceflow {

namespace {

constexpr double pi = 3.14159265358979323846;

void take_number(const JsonField& field, const char* key, double& value) {
  if (field.has(key)) value = field[key].number(-largest_pixels, largest_pixels);
}

void take_positive(const JsonField& field, const char* key, std::optional<double>& value) {
  if (!field.has(key)) return;
  field[key].positive();
  value = field[key].number(smallest_pixels, largest_pixels);
}

// Reads an angle in the unit in which half a turn is `half_turn`, and converts it to radians.
void take_angle(const JsonField& field, const char* key, double half_turn, std::optional<double>& radians) {
  if (!field.has(key)) return;
  std::optional<double> angle;
  take_positive(field, key, angle);
  if (!(*angle < half_turn)) field[key].expect(half_turn == pi ? "an angle below π" : "an angle below 180°");
  radians = *angle * (pi / half_turn);
}

constexpr const char* known_models = "OPENCV, OPENCV_FISHEYE, PINHOLE or a simpler model of these";
constexpr const char* undistort_remedy = "undistort the images with the program that made them";

// The names of nerfstudio, and COLMAP's names of models with the same k1 to k4, p1 and p2.
bool is_fisheye_model(const JsonField& field) {
  constexpr std::array<std::string_view, 5> perspective = {"OPENCV", "PINHOLE", "SIMPLE_PINHOLE",
                                                           "SIMPLE_RADIAL", "RADIAL"};
  constexpr std::array<std::string_view, 3> fisheye = {"OPENCV_FISHEYE", "RADIAL_FISHEYE",
                                                       "SIMPLE_RADIAL_FISHEYE"};
  const std::string model = field.text();
  if (std::ranges::find(fisheye, model) != fisheye.end()) return true;
  if (std::ranges::find(perspective, model) != perspective.end()) return false;
  field.fail(model, known_models, undistort_remedy);
}

// Whether the value disables its key: false, zero, or a list of such values.
bool is_off(const nlohmann::json& value) {
  if (value.is_array()) return std::ranges::all_of(value, is_off);
  if (value.is_boolean()) return !value.get<bool>();
  return value.is_null() || (value.is_number() && value.get<double>() == 0);
}

// Refuses lenses that instant-ngp and nerfstudio mark by separate keys. Ignoring these keys would leave a
// wrong pinhole.
void refuse_other_lenses(const JsonField& field) {
  const auto is_on = [&](const char* key) { return field.has(key) && !is_off(field[key].json()); };
  for (const auto& [key, lens] : {std::pair{"ftheta_p0", "an f-theta lens"},
                                  {"ftheta_p1", "an f-theta lens"},
                                  {"ftheta_p2", "an f-theta lens"},
                                  {"ftheta_p3", "an f-theta lens"},
                                  {"ftheta_p4", "an f-theta lens"},
                                  {"latlong", "a panorama"},
                                  {"equirectangular", "a panorama"},
                                  {"orthographic", "an orthographic camera"}}) {
    if (is_on(key)) field[key].fail(lens, known_models, undistort_remedy);
  }
  if (is_on("distortion_params"))
    field["distortion_params"].fail("a list of distortion", "k1 to k4, p1 and p2", undistort_remedy);
}

}  // namespace

void TransformsLens::take(const JsonField& field) {
  take_positive(field, "w", width);
  take_positive(field, "h", height);
  // A frame's angle overrides all values that the file gives for all frames.
  constexpr std::array angles = {"camera_angle_x", "camera_angle_y", "x_fov", "y_fov"};
  if (std::ranges::any_of(angles, [&](const char* key) { return field.has(key); })) {
    for (auto* inherited : {&focal_x, &focal_y, &angle_x, &angle_y}) inherited->reset();
  }
  for (const auto& [key, focal] :
       {std::pair{"fl_x", &focal_x}, {"fl_y", &focal_y}, {"fx", &focal_x}, {"fy", &focal_y}})
    take_positive(field, key, *focal);
  take_angle(field, "camera_angle_x", pi, angle_x);
  take_angle(field, "camera_angle_y", pi, angle_y);
  // Degrees override radians, as in instant-ngp and nerfstudio.
  take_angle(field, "x_fov", 180, angle_x);
  take_angle(field, "y_fov", 180, angle_y);
  for (const auto& [key, centre] : {std::pair{"cx", &centre_x}, {"cy", &centre_y}}) {
    if (field.has(key)) *centre = field[key].number(-largest_pixels, largest_pixels);
  }
  take_number(field, "k1", k1);
  take_number(field, "k2", k2);
  take_number(field, "k3", k3);
  take_number(field, "k4", k4);
  take_number(field, "p1", p1);
  take_number(field, "p2", p2);
  if (field.has("K")) {
    const std::vector<JsonField> rows = field["K"].elements(3);
    const std::vector<double> x = rows[0].numbers(3), y = rows[1].numbers(3);
    if (!(x[0] > smallest_pixels && x[0] < largest_pixels && y[1] > smallest_pixels &&
          y[1] < largest_pixels && std::abs(x[1]) < largest_pixels))
      field["K"].expect("focal lengths above zero");
    for (const double place : {x[2], y[2]}) {
      if (!(std::abs(place) < largest_pixels)) field["K"].expect("a principal point near the image");
    }
    focal_x = x[0];
    focal_y = y[1];
    centre_x = x[2];
    centre_y = y[2];
    skew = x[1];
  }
  if (field.has("rolling_shutter")) rolling_shutter = !is_off(field["rolling_shutter"].json());
  if (field.has("is_fisheye")) is_fisheye = field["is_fisheye"].yes();
  if (field.has("camera_model")) is_fisheye = is_fisheye_model(field["camera_model"]);
  refuse_other_lenses(field);
}

Lens TransformsLens::lens(double image_width, double image_height, const JsonField& field) const {
  Lens lens;
  lens.width = width.value_or(image_width);
  lens.height = height.value_or(image_height);
  const auto focal_of = [](const std::optional<double>& angle, double side) {
    return angle ? std::optional<double>(0.5 * side / std::tan(0.5 * *angle)) : std::nullopt;
  };
  const std::optional<double> x = focal_x ? focal_x : focal_of(angle_x, lens.width);
  const std::optional<double> by_angle = focal_x ? std::nullopt : focal_of(angle_y, lens.height);
  const std::optional<double> y = focal_y ? focal_y : by_angle ? by_angle : x;
  if (!y) field.fail("no focal length", "fl_x, camera_angle_x or K");
  lens.focal = {x.value_or(*y), *y};
  lens.centre = {centre_x.value_or(lens.width / 2), centre_y.value_or(lens.height / 2)};
  lens.skew = skew;
  lens.radial = {k1, k2, k3};
  lens.radial_4 = k4;
  if (is_fisheye) {
    lens.projection = Projection::equidistant;
  } else {
    lens.tangential = {p1, p2};
  }
  return lens;
}

TransformsPose read_transform_matrix(const JsonField& field) {
  constexpr double tolerance = 1e-2;
  std::vector<JsonField> rows = field.elements();
  if (rows.size() != 3 && rows.size() != 4) field.expect("three or four rows of four numbers");
  Mat3<double> axes(0);
  Vec3<double> position(0);
  for (int r = 0; r < 3; ++r) {
    const std::vector<JsonField> row = rows[static_cast<size_t>(r)].elements(4);
    for (int c = 0; c < 3; ++c) axes[c][r] = row[static_cast<size_t>(c)].number(-1e6, 1e6);
    position[r] = row[3].number(-1e15, 1e15);
  }
  const double volume = determinant(axes);
  if (!(volume > 1e-18)) field.fail(volume < 0 ? "a mirrored frame" : "axes in one plane", "a rotation");
  axes /= std::cbrt(volume);
  const Mat3<double> error = transpose(axes) * axes - Mat3<double>(1);
  for (int i = 0; i < 9; ++i) {
    if (!(std::abs(error[i / 3][i % 3]) <= tolerance))
      field.fail("axes that are not orthonormal", "a rotation");
  }
  for (int step = 0; step < 4; ++step) axes = 0.5 * (axes + inverse(transpose(axes)));
  const Mat3<double> world_from_camera(axes[0], -axes[1], -axes[2]);
  return {transpose(world_from_camera), position};
}

}  // namespace traceflow
