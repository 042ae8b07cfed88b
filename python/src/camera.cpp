#include "camera.h"

#include <fmt/format.h>

#include <cmath>

#include "parts.h"

namespace traceflow::python {

namespace {

Mat3<float> matrix_from(const py::object& array, const std::string& name) {
  const auto read = tensor_of_array<float>(array, name, {3, 3});
  Mat3<float> matrix;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) matrix[column][row] = (*read)(row, column);
  }
  return matrix;
}

Vec3<float> vector_from(const py::object& array, const std::string& name) {
  return load3<float>(tensor_of_array<float>(array, name, {3})->data());
}

constexpr int most_pixels_a_side = 16384;

void check_camera(const Camera<float>& camera) {
  const auto expect = [](bool fits, const char* name, const std::string& found, const char* expected) {
    if (!fits) throw InputError("argument", name, found, expected);
  };
  for (const auto& [size, name] : {std::pair{camera.width, "width"}, {camera.height, "height"}}) {
    expect(size >= 1 && size <= most_pixels_a_side, name, fmt::format("{}", size), "1 to 16384 pixels");
  }
  for (const auto& [focal, name] : {std::pair{camera.focal_x, "focal_x"}, {camera.focal_y, "focal_y"}}) {
    expect(std::isfinite(focal) && focal > 0, name, fmt::format("{}", focal), "a positive number of pixels");
  }
  const Mat3<float> rest = camera.camera_from_world * transpose(camera.camera_from_world) - Mat3<float>(1);
  float largest = 0;
  for (int i = 0; i < 9; ++i) largest = std::max(largest, std::fabs(rest[i / 3][i % 3]));
  constexpr float tolerance = 1e-3F;
  expect(largest < tolerance && determinant(camera.camera_from_world) > 0, "camera_from_world",
         "a matrix that does not rotate", "a rotation matrix");
  expect(is_finite(camera.position), "position", "a number that is not finite", "three finite numbers");
}

Camera<float> make_camera(int width, int height, float focal_x, const py::object& focal_y,
                          const py::object& centre_x, const py::object& centre_y,
                          const py::object& camera_from_world, const py::object& position) {
  Camera<float> camera;
  camera.width = width;
  camera.height = height;
  camera.focal_x = focal_x;
  camera.focal_y = focal_y.is_none() ? focal_x : py::cast<float>(focal_y);
  camera.centre_x = centre_x.is_none() ? static_cast<float>(width) / 2 : py::cast<float>(centre_x);
  camera.centre_y = centre_y.is_none() ? static_cast<float>(height) / 2 : py::cast<float>(centre_y);
  if (!camera_from_world.is_none())
    camera.camera_from_world = matrix_from(camera_from_world, "camera_from_world");
  if (!position.is_none()) camera.position = vector_from(position, "position");
  check_camera(camera);
  return camera;
}

Camera<float> looking_at(const py::object& position, const py::object& target, const py::object& up,
                         int width, int height, double fov_y) {
  const Vec3<float> from = vector_from(position, "position");
  const Vec3<float> forward = vector_from(target, "target") - from, upwards = vector_from(up, "up");
  const Vec3<float> right = cross(forward, upwards);
  if (!(length(right) > 0)) {
    throw InputError("argument", "target", "a direction along `up`, or none",
                     "a target away from the position, and not above it");
  }
  if (!(fov_y > 0 && fov_y < 180))
    throw InputError("argument", "fov_y", fmt::format("{}", fov_y), "0 to 180 degrees, exclusive");
  const Vec3<float> x = normalize(right), z = normalize(forward), y = cross(z, x);
  constexpr double degree = 3.14159265358979323846 / 180;
  Camera<float> camera;
  camera.width = width;
  camera.height = height;
  camera.focal_x = camera.focal_y = static_cast<float>(height / 2.0 / std::tan(fov_y / 2 * degree));
  camera.centre_x = static_cast<float>(width) / 2;
  camera.centre_y = static_cast<float>(height) / 2;
  camera.camera_from_world = transpose(Mat3<float>(x, y, z));
  camera.position = from;
  check_camera(camera);
  return camera;
}

// The same rays in an image of another size.
Camera<float> resized(const Camera<float>& camera, int width, int height) {
  const float by_x = static_cast<float>(width) / static_cast<float>(camera.width),
              by_y = static_cast<float>(height) / static_cast<float>(camera.height);
  Camera<float> result = camera;
  result.width = width;
  result.height = height;
  result.focal_x *= by_x;
  result.centre_x *= by_x;
  result.focal_y *= by_y;
  result.centre_y *= by_y;
  check_camera(result);
  return result;
}

// A property that is checked with the whole camera when it is set.
template <class T>
void add_number(py::class_<Camera<float>>& kind, const char* name, T Camera<float>::*member,
                const char* doc) {
  kind.def_property(
      name, [member](const Camera<float>& self) { return self.*member; },
      [member](Camera<float>& self, T value) {
        Camera<float> changed = self;
        changed.*member = value;
        check_camera(changed);
        self = changed;
      },
      doc);
}

std::string text_of(const Camera<float>& c) {
  return fmt::format(
      "Camera(width={}, height={}, focal_x={}, focal_y={}, centre_x={}, centre_y={}, position=({}, {}, {}))",
      c.width, c.height, c.focal_x, c.focal_y, c.centre_x, c.centre_y, c.position.x, c.position.y,
      c.position.z);
}

}  // namespace

py::array matrix_of(const Mat3<float>& matrix) {
  Tensor<float> rows({3, 3});
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) rows(row, column) = matrix[column][row];
  }
  return array_of(std::move(rows));
}

py::array vector_of(const Vec3<float>& vector) {
  Tensor<float> numbers({3});
  store3(numbers.data(), vector);
  return array_of(std::move(numbers));
}

py::dict dict_of(const CameraGradient<float>& gradient) {
  py::dict result;
  result["camera_from_world"] = matrix_of(gradient.camera_from_world);
  result["position"] = vector_of(gradient.position);
  return result;
}

void add_camera(py::module_& module) {
  py::class_<Camera<float>> kind(module, "Camera",
                                 "A pinhole camera in the normalised scene. Axes are OpenCV's: x right, y "
                                 "down, z forward; pixel (i, j) has its centre at (i + 0.5, j + 0.5).");
  kind.def(py::init(&make_camera), py::arg("width"), py::arg("height"), py::arg("focal_x"),
           py::arg("focal_y") = py::none(), py::arg("centre_x") = py::none(),
           py::arg("centre_y") = py::none(), py::arg("camera_from_world") = py::none(),
           py::arg("position") = py::none(),
           "Sizes, focal lengths and the principal point (the middle, if not given) are in pixels. "
           "camera_from_world: rotation, 3×3. position: 3, scene units.");
  kind.def_static("look_at", &looking_at, py::arg("position"), py::arg("target"), py::arg("up"),
                  py::arg("width"), py::arg("height"), py::arg("fov_y") = 45.0,
                  "A camera at `position` that looks at `target` (3 each, scene units), with `up` pointing "
                  "up in the image. fov_y: full vertical angle, degrees.");
  add_number(kind, "width", &Camera<float>::width, "Pixels.");
  add_number(kind, "height", &Camera<float>::height, "Pixels.");
  add_number(kind, "focal_x", &Camera<float>::focal_x, "Pixels.");
  add_number(kind, "focal_y", &Camera<float>::focal_y, "Pixels.");
  add_number(kind, "centre_x", &Camera<float>::centre_x, "Principal point, pixels.");
  add_number(kind, "centre_y", &Camera<float>::centre_y, "Principal point, pixels.");
  kind.def_property(
          "camera_from_world", [](const Camera<float>& self) { return matrix_of(self.camera_from_world); },
          [](Camera<float>& self, const py::object& value) {
            Camera<float> changed = self;
            changed.camera_from_world = matrix_from(value, "camera_from_world");
            check_camera(changed);
            self = changed;
          },
          "Rotation, 3×3 float32. A copy: assign to it to change it.")
      .def_property(
          "position", [](const Camera<float>& self) { return vector_of(self.position); },
          [](Camera<float>& self, const py::object& value) {
            Camera<float> changed = self;
            changed.position = vector_from(value, "position");
            check_camera(changed);
            self = changed;
          },
          "Centre of projection, 3 float32, scene units. A copy: assign to it to change it.")
      .def("resized", &resized, py::arg("width"), py::arg("height"),
           "The same view in an image of another size (pixels).")
      .def(
          "copy", [](const Camera<float>& self) { return self; }, "A camera with the same values.")
      .def("__repr__", &text_of);
}

}  // namespace traceflow::python
