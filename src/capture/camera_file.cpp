#include "capture/camera_file.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "capture/json_file.h"

namespace traceflow {

namespace {

Mat3<double> read_rotation(const JsonField& field) {
  constexpr double tolerance = 1e-2;
  Mat3<double> rotation;
  const std::vector<JsonField> rows = field.elements(3);
  for (int row = 0; row < 3; ++row) {
    const std::vector<double> numbers = rows[static_cast<size_t>(row)].numbers(3);
    for (int column = 0; column < 3; ++column) rotation[column][row] = numbers[static_cast<size_t>(column)];
  }
  const Mat3<double> error = transpose(rotation) * rotation - Mat3<double>(1);
  double worst = 0;
  for (int i = 0; i < 9; ++i) worst = std::max(worst, std::abs(error[i / 3][i % 3]));
  if (worst > tolerance || !(determinant(rotation) > 0)) {
    field.fail("a matrix that is not a rotation", "the rotation camera_from_world, row by row");
  }
  // The nearest rotation: files carry few digits, and these add up where normals are turned.
  for (int step = 0; step < 4 && worst > 1e-12; ++step)
    rotation = 0.5 * (rotation + inverse(transpose(rotation)));
  return rotation;
}

}  // namespace

CapturedCamera read_camera(const std::filesystem::path& path) {
  const JsonFile file(path);
  CapturedCamera camera;
  camera.camera_from_world = read_rotation(file["orientation"]);
  camera.position = load3<double>(file["position"].numbers(3).data());
  Lens& lens = camera.lens;
  const std::vector<JsonField> size = file["image_size"].elements(2);
  lens.width = size[0].positive();
  lens.height = size[1].positive();
  const double aspect = file.has("pixel_aspect_ratio") ? file["pixel_aspect_ratio"].positive() : 1;
  const double focal = file["focal_length"].positive();
  lens.focal = {focal, focal * aspect};
  const std::vector<double> centre = file["principal_point"].numbers(2);
  lens.centre = {centre[0], centre[1]};
  if (file.has("skew")) lens.skew = file["skew"].number();
  if (file.has("radial_distortion")) lens.radial = load3<double>(file["radial_distortion"].numbers(3).data());
  const char* tangential = file.has("tangential") ? "tangential" : "tangential_distortion";
  if (file.has(tangential)) {
    const std::vector<double> p = file[tangential].numbers(2);
    lens.tangential = {p[0], p[1]};
  }
  return camera;
}

}  // namespace traceflow
