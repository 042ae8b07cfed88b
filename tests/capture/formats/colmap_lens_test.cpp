#include "capture/formats/colmap/colmap_lens.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/random.h"
#include "support/refusal.h"

namespace traceflow {
namespace {

using Numbers = std::vector<double>;

struct Model {
  const char* name;
  Numbers parameters;
  // The pixel of the direction (u, v, 1), p being the parameters: each model written out for itself.
  Vec2<double> (*pixel)(const Numbers& p, double u, double v);
};

// tan θ to θ, along the same direction.
Vec2<double> angle(double u, double v) {
  const double r = std::hypot(u, v);
  return r > 0 ? Vec2<double>(u, v) * std::atan2(r, 1) / r : Vec2<double>(0);
}

const Model models[] = {
    {"SIMPLE_PINHOLE",
     {50, 31, 25},
     [](const Numbers& p, double u, double v) { return Vec2<double>(p[0] * u + p[1], p[0] * v + p[2]); }},
    {"PINHOLE",
     {50, 60, 31, 25},
     [](const Numbers& p, double u, double v) { return Vec2<double>(p[0] * u + p[2], p[1] * v + p[3]); }},
    {"SIMPLE_RADIAL",
     {50, 31, 25, 0.1},
     [](const Numbers& p, double u, double v) {
       const double k = 1 + p[3] * (u * u + v * v);
       return Vec2<double>(p[0] * u * k + p[1], p[0] * v * k + p[2]);
     }},
    {"RADIAL",
     {50, 31, 25, 0.1, -0.05},
     [](const Numbers& p, double u, double v) {
       const double r2 = u * u + v * v, k = 1 + p[3] * r2 + p[4] * r2 * r2;
       return Vec2<double>(p[0] * u * k + p[1], p[0] * v * k + p[2]);
     }},
    {"OPENCV",
     {50, 60, 31, 25, 0.1, -0.05, 0.01, -0.02},
     [](const Numbers& p, double u, double v) {
       const double r2 = u * u + v * v, k = 1 + p[4] * r2 + p[5] * r2 * r2;
       return Vec2<double>(p[0] * (u * k + 2 * p[6] * u * v + p[7] * (r2 + 2 * u * u)) + p[2],
                           p[1] * (v * k + 2 * p[7] * u * v + p[6] * (r2 + 2 * v * v)) + p[3]);
     }},
    {"OPENCV_FISHEYE",
     {50, 60, 31, 25, 0.1, -0.05, 0.02, -0.01},
     [](const Numbers& p, double u, double v) {
       const double r = std::hypot(u, v), t = std::atan(r), t2 = t * t;
       const double d = t * (1 + p[4] * t2 + p[5] * t2 * t2 + p[6] * t2 * t2 * t2 + p[7] * t2 * t2 * t2 * t2);
       return Vec2<double>(p[0] * d / r * u + p[2], p[1] * d / r * v + p[3]);
     }},
    {"FULL_OPENCV",
     {50, 60, 31, 25, 0.1, -0.05, 0.01, -0.02, 0.03, 0.2, -0.1, 0.04},
     [](const Numbers& p, double u, double v) {
       const double r2 = u * u + v * v, r4 = r2 * r2, r6 = r4 * r2;
       const double k = (1 + p[4] * r2 + p[5] * r4 + p[8] * r6) / (1 + p[9] * r2 + p[10] * r4 + p[11] * r6);
       return Vec2<double>(p[0] * (u * k + 2 * p[6] * u * v + p[7] * (r2 + 2 * u * u)) + p[2],
                           p[1] * (v * k + 2 * p[7] * u * v + p[6] * (r2 + 2 * v * v)) + p[3]);
     }},
    {"FOV",
     {50, 60, 31, 25, 0.8},
     [](const Numbers& p, double u, double v) {
       const double r = std::hypot(u, v), d = std::atan(2 * r * std::tan(p[4] / 2)) / p[4];
       return Vec2<double>(p[0] * d / r * u + p[2], p[1] * d / r * v + p[3]);
     }},
    {"SIMPLE_RADIAL_FISHEYE",
     {50, 31, 25, 0.1},
     [](const Numbers& p, double u, double v) {
       const Vec2<double> a = angle(u, v);
       return p[0] * a * (1 + p[3] * dot(a, a)) + Vec2<double>(p[1], p[2]);
     }},
    {"RADIAL_FISHEYE",
     {50, 31, 25, 0.1, -0.05},
     [](const Numbers& p, double u, double v) {
       const Vec2<double> a = angle(u, v);
       const double t2 = dot(a, a);
       return p[0] * a * (1 + p[3] * t2 + p[4] * t2 * t2) + Vec2<double>(p[1], p[2]);
     }},
    {"THIN_PRISM_FISHEYE",
     {50, 60, 31, 25, 0.1, -0.05, 0.01, -0.02, 0.03, -0.01, 0.005, -0.007},
     [](const Numbers& p, double u, double v) {
       const Vec2<double> a = angle(u, v);
       const double t2 = dot(a, a), k = 1 + t2 * (p[4] + t2 * (p[5] + t2 * (p[8] + t2 * p[9])));
       const double x = a.x * k + 2 * p[6] * a.x * a.y + p[7] * (t2 + 2 * a.x * a.x) + p[10] * t2;
       const double y = a.y * k + 2 * p[7] * a.x * a.y + p[6] * (t2 + 2 * a.y * a.y) + p[11] * t2;
       return Vec2<double>(p[0] * x + p[2], p[1] * y + p[3]);
     }},
    {"SIMPLE_FISHEYE",
     {50, 31, 25},
     [](const Numbers& p, double u, double v) { return p[0] * angle(u, v) + Vec2<double>(p[1], p[2]); }},
    {"FISHEYE", {50, 60, 31, 25}, [](const Numbers& p, double u, double v) {
       return Vec2<double>(p[0], p[1]) * angle(u, v) + Vec2<double>(p[2], p[3]);
     }}};

Lens lens_of(const std::string& name, const Numbers& parameters) {
  return colmap_lens(*find_colmap_lens_model(name), parameters, 64, 48, "cameras.bin", "cameras[0]");
}

TEST(ColmapLens, every_model_projects_by_its_own_formula) {
  Random random(3);
  for (const Model& model : models) {
    const Lens lens = lens_of(model.name, model.parameters);
    EXPECT_EQ(lens.width, 64);
    EXPECT_EQ(lens.height, 48);
    for (int i = 0; i < 100; ++i) {
      const double u = random.uniform(-0.8, 0.8), v = random.uniform(-0.8, 0.8);
      const Vec2<double> expected = model.pixel(model.parameters, u, v);
      EXPECT_LT(length(lens.pixel_from_ideal({u, v}) - expected), 1e-9) << model.name;
      EXPECT_LT(length(lens.ideal_from_pixel(expected) - Vec2<double>(u, v)), 1e-9) << model.name;
    }
  }
}

TEST(ColmapLens, zero_distortion_is_a_pinhole) {
  for (const Model& model : models) {
    Numbers parameters = model.parameters;
    const std::string name = model.name;
    const size_t first = name.starts_with("SIMPLE") || name.starts_with("RADIAL") ? 3 : 4;
    for (size_t i = first; i < parameters.size(); ++i) parameters[i] = 0;
    EXPECT_EQ(lens_of(name, parameters).is_pinhole(), name.find("FISHEYE") == std::string::npos) << name;
  }
}

TEST(ColmapLens, a_field_of_view_near_zero_is_hardly_a_distortion) {
  const Lens lens = lens_of("FOV", {50, 60, 31, 25, 1e-6});
  EXPECT_LT(length(lens.pixel_from_ideal({0.3, -0.4}) - Vec2<double>(46, 1)), 1e-9);
  EXPECT_EQ(lens_of("FOV", {50, 60, 31, 25, -0.8}).omega, 0.8);
}

TEST(ColmapLens, models_are_found_by_number_and_by_name) {
  for (int id = 0; id < 18; ++id) {
    const ColmapLensModel* model = find_colmap_lens_model(id);
    ASSERT_NE(model, nullptr);
    EXPECT_EQ(find_colmap_lens_model(model->name), model);
  }
  EXPECT_EQ(find_colmap_lens_model(18), nullptr);
  EXPECT_EQ(find_colmap_lens_model(-1), nullptr);
  EXPECT_EQ(find_colmap_lens_model("opencv"), nullptr);
}

std::string refusal(const std::string& name, const Numbers& parameters, double width = 64) {
  return refusal_of([&] {
    colmap_lens(*find_colmap_lens_model(name), parameters, width, 48, "cameras.bin", "cameras[7]");
  });
}

TEST(ColmapLens, what_no_lens_can_be_is_refused_by_name) {
  for (const char* name :
       {"RAD_TAN_THIN_PRISM_FISHEYE", "SIMPLE_DIVISION", "DIVISION", "EUCM", "EQUIRECTANGULAR"}) {
    const std::string line = refusal(name, Numbers(find_colmap_lens_model(name)->parameters, 1));
    EXPECT_NE(line.find(std::string("cameras.bin: cameras[7].model: found ") + name), std::string::npos)
        << line;
  }
}

TEST(ColmapLens, parameters_that_make_no_camera_are_refused_by_name) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::tuple<std::string, Numbers, double, std::string> cases[] = {
      {"PINHOLE", {50, 60, 31}, 64, "cameras[7].params: found 3 numbers, expected 4 (PINHOLE)"},
      {"PINHOLE", {50, 60, 31, 25, 0}, 64, "cameras[7].params: found 5 numbers"},
      {"PINHOLE", {0, 60, 31, 25}, 64, "cameras[7].params[0]: found 0"},
      {"PINHOLE", {50, -1, 31, 25}, 64, "cameras[7].params[1]: found -1"},
      {"SIMPLE_RADIAL", {50, 31, nan, 0}, 64, "cameras[7].params[2]: found"},
      {"SIMPLE_RADIAL", {50, 31, 25, 1e300}, 64, "cameras[7].params[3]: found"},
      {"FOV", {50, 60, 31, 25, 3.2}, 64, "cameras[7].params[4]: found 3.2"},
      {"PINHOLE", {50, 60, 31, 25}, 0, "cameras[7].width: found 0"},
      {"PINHOLE", {50, 60, 31, 25}, 1e18, "cameras[7].width: found 1"}};
  for (const auto& [name, parameters, width, expected] : cases) {
    const std::string line = refusal(name, parameters, width);
    EXPECT_NE(line.find("cameras.bin: " + expected), std::string::npos) << line;
  }
}

}  // namespace
}  // namespace traceflow
