#include "capture/formats/colmap/colmap_lens.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "math/pixel_limits.h"

namespace traceflow {

namespace {

constexpr std::array<ColmapLensModel, 18> models = {{{0, "SIMPLE_PINHOLE", 3},
                                                     {1, "PINHOLE", 4},
                                                     {2, "SIMPLE_RADIAL", 4},
                                                     {3, "RADIAL", 5},
                                                     {4, "OPENCV", 8},
                                                     {5, "OPENCV_FISHEYE", 8},
                                                     {6, "FULL_OPENCV", 12},
                                                     {7, "FOV", 5},
                                                     {8, "SIMPLE_RADIAL_FISHEYE", 4},
                                                     {9, "RADIAL_FISHEYE", 5},
                                                     {10, "THIN_PRISM_FISHEYE", 12},
                                                     {11, "RAD_TAN_THIN_PRISM_FISHEYE", 16},
                                                     {12, "SIMPLE_DIVISION", 4},
                                                     {13, "DIVISION", 5},
                                                     {14, "SIMPLE_FISHEYE", 3},
                                                     {15, "FISHEYE", 4},
                                                     {16, "EUCM", 6},
                                                     {17, "EQUIRECTANGULAR", 2}}};

bool is_supported(std::string_view name) {
  constexpr std::string_view unsupported[] = {"RAD_TAN_THIN_PRISM_FISHEYE", "SIMPLE_DIVISION", "DIVISION",
                                              "EUCM", "EQUIRECTANGULAR"};
  return std::find(std::begin(unsupported), std::end(unsupported), name) == std::end(unsupported);
}

// Models with one focal length store it once.
bool has_one_focal(std::string_view name) {
  return name.starts_with("SIMPLE_") || name.starts_with("RADIAL");
}

// p: the parameters after the principal point.
void set_distortion(Lens& lens, std::string_view name, std::span<const double> p) {
  if (name == "SIMPLE_RADIAL" || name == "SIMPLE_RADIAL_FISHEYE") {
    lens.radial = {p[0], 0, 0};
  } else if (name == "RADIAL" || name == "RADIAL_FISHEYE") {
    lens.radial = {p[0], p[1], 0};
  } else if (name == "OPENCV") {
    lens.radial = {p[0], p[1], 0};
    lens.tangential = {p[2], p[3]};
  } else if (name == "FULL_OPENCV") {
    lens.radial = {p[0], p[1], p[4]};
    lens.tangential = {p[2], p[3]};
    lens.radial_below = {p[5], p[6], p[7]};
  } else if (name == "OPENCV_FISHEYE") {
    lens.radial = {p[0], p[1], p[2]};
    lens.radial_4 = p[3];
  } else if (name == "THIN_PRISM_FISHEYE") {
    lens.radial = {p[0], p[1], p[4]};
    lens.radial_4 = p[5];
    lens.tangential = {p[2], p[3]};
    lens.prism = {p[6], 0, p[7], 0};
  } else if (name == "FOV") {
    lens.omega = std::abs(p[0]);
    if (lens.omega > 0) lens.projection = Projection::fov;
  }
  if (name.ends_with("FISHEYE")) lens.projection = Projection::equidistant;
}

}  // namespace

const ColmapLensModel* find_colmap_lens_model(int id) {
  const auto found = std::ranges::find(models, id, &ColmapLensModel::id);
  return found == models.end() ? nullptr : &*found;
}

const ColmapLensModel* find_colmap_lens_model(std::string_view name) {
  const auto found = std::ranges::find(models, name, &ColmapLensModel::name);
  return found == models.end() ? nullptr : &*found;
}

Lens colmap_lens(const ColmapLensModel& model, std::span<const double> parameters, double width,
                 double height, const std::string& where, const std::string& field) {
  const std::string name(model.name);
  if (!is_supported(name)) {
    throw InputError(where, field + ".model", name, "a perspective or equidistant fisheye camera",
                     "undistort the images with colmap image_undistorter");
  }
  const auto check = [&](bool ok, double value, const std::string& part, const std::string& expected) {
    if (!ok) throw InputError(where, field + "." + part, std::to_string(value), expected);
  };
  if (parameters.size() != model.parameters) {
    throw InputError(where, field + ".params", std::to_string(parameters.size()) + " numbers",
                     std::to_string(model.parameters) + " (" + name + ")");
  }
  check(width > 0 && width < largest_pixels, width, "width", "a number of pixels above zero");
  check(height > 0 && height < largest_pixels, height, "height", "a number of pixels above zero");
  for (size_t i = 0; i < parameters.size(); ++i) {
    check(std::abs(parameters[i]) < largest_pixels, parameters[i], "params[" + std::to_string(i) + "]",
          "a finite number");
  }
  const size_t focals = has_one_focal(name) ? 1 : 2;
  for (size_t i = 0; i < focals; ++i) {
    check(parameters[i] > smallest_pixels, parameters[i], "params[" + std::to_string(i) + "]",
          "a focal length above zero");
  }
  Lens lens;
  lens.width = width;
  lens.height = height;
  lens.focal = {parameters[0], parameters[focals - 1]};
  lens.centre = {parameters[focals], parameters[focals + 1]};
  set_distortion(lens, name, parameters.subspan(focals + 2));
  constexpr double pi = 3.14159265358979323846;
  check(lens.omega < pi, lens.omega, "params[4]", "a field of view below π");
  return lens;
}

}  // namespace traceflow
