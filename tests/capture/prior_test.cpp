#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "base/random.h"
#include "capture/capture.h"
#include "capture/prior_axes.h"
#include "fake_capture.h"
#include "files/npy.h"
#include "support/file_bytes.h"
#include "support/zip_writer.h"

namespace traceflow {
namespace {

// World axes of a camera turned about y by 90° (x_camera = −z_world, z_camera = x_world) for a prior whose
// own axes are OpenGL's: (x, y, z) → camera (x, −y, −z) → world.
Vec3<float> expected_world(const Vec3<float>& prior) { return {-prior.z, -prior.y, -prior.x}; }

FakeCapture::Json turned() { return {{0, 0, -1}, {0, 1, 0}, {1, 0, 0}}; }

Vec3<float> direction(int64_t i) {
  return normalize(Vec3<float>(static_cast<float>(i % 5) - 2, static_cast<float>(i % 7) - 3, 3.5F));
}

TEST(Priors, png_values_turn_to_unit_world_normals) {
  NerfDsCapture fake;
  fake.cameras["000001_left"]["orientation"] = turned();
  Tensor<uint8_t> prior({8, 12, 3});
  for (int64_t i = 0; i < 96; ++i) {
    for (int c = 0; c < 3; ++c)
      prior[3 * i + c] = static_cast<uint8_t>(std::lround(127.5F * (direction(i)[c] + 1)));
  }
  // Black, white and middle grey say "no value".
  const uint8_t nothing[] = {0, 0, 0, 255, 255, 255, 128, 127, 128};
  std::copy(std::begin(nothing), std::end(nothing), prior.data());
  fake.write_image("normal/1x/000001_left.png", prior);
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_TRUE(capture.has_normal_priors);
  EXPECT_EQ(capture.prior_axes, PriorAxes::opengl);
  EXPECT_TRUE(has_warning(capture, "3 of 4 training views have no normal prior"));
  const auto images = load_images(capture, capture.train[1]);
  ASSERT_EQ(images->normal_prior.shape(), (Shape{8, 12, 3}));
  for (int64_t i = 0; i < 96; ++i) {
    const Vec3<float> found = load3<float>(&images->normal_prior[3 * i]);
    if (i < 3) {
      EXPECT_EQ(found, Vec3<float>(0));
    } else {
      EXPECT_NEAR(length(found), 1, 1e-5);
      EXPECT_LT(length(found - expected_world(direction(i))), 0.012) << i;
    }
  }
  EXPECT_TRUE(load_images(capture, capture.train[0])->normal_prior.empty());
}

TEST(Priors, turn_with_the_view_in_the_mask_alone) {
  NerfDsCapture fake;
  Tensor<uint8_t> mask({8, 12});
  for (int64_t i = 30; i < 60; ++i) mask[i] = 255;
  Tensor<float> array({4, 8, 12, 3});
  for (int64_t i = 0; i < array.size(); i += 3) store3(&array[i], direction(i));
  fake.write_image("mask/1x/000000_left.png.png", mask);
  write_npy(fake.path() / "normal.npy", array);
  fake.save();
  Capture capture = load_capture(fake.path(), {});
  View& view = capture.train[0];
  const auto before = load_images(capture, view);
  view.prior_turn = Mat3<float>(0, 1, 0, 0, 0, 1, 1, 0, 0);  // (x, y, z) → (z, x, y)
  const auto turned = load_images(capture, view);
  for (int64_t i = 0; i < mask.size(); ++i) {
    const Vec3<float> n = load3<float>(&before->normal_prior[3 * i]);
    const Vec3<float> expected = mask[i] != 0 ? Vec3<float>(n.z, n.x, n.y) : n;
    EXPECT_EQ(load3<float>(&turned->normal_prior[3 * i]), expected) << i;
  }
  capture.train[1].prior_turn = view.prior_turn;  // and has no mask
  EXPECT_FALSE(load_images(capture, capture.train[1])->normal_prior.empty());
}

// Frame t of an array of priors, of odd lengths and with holes.
void fill_frame(Tensor<float>& array, int64_t t) {
  for (int64_t i = 0; i < 96; ++i) {
    const Vec3<float> n = (0.5F + static_cast<float>(t)) * direction(i + t);
    store3(array.row(t) + 3 * i, i == 4 ? Vec3<float>(NAN, 0, 1) : i == 5 ? Vec3<float>(0.01F, 0, 0.01F) : n);
  }
}

void expect_frame(const Capture& capture, size_t view, int64_t t) {
  const auto images = load_images(capture, capture.train[view]);
  for (int64_t i = 0; i < 96; ++i) {
    const Vec3<float> found = load3<float>(&images->normal_prior[3 * i]);
    const Vec3<float> n = direction(i + t);
    const Vec3<float> expected = i == 4 || i == 5 ? Vec3<float>(0) : Vec3<float>(n.x, -n.y, -n.z);
    EXPECT_LT(length(found - expected), 1e-4) << view << " " << i;
  }
}

TEST(Priors, arrays_have_one_element_for_each_training_view) {
  NerfDsCapture fake;
  Tensor<float> array({4, 8, 12, 3});
  for (int64_t t = 0; t < 4; ++t) fill_frame(array, t);
  write_npy(fake.path() / "normal.npy", array);
  // A missing image must not shift the views behind it.
  std::filesystem::remove(fake.path() / "rgb/1x/000001_left.png");
  fake.save();
  for (const bool as_npz : {false, true}) {
    if (as_npz) {
      fake.write_text("normal.npz", zip_archive({{"depth.npy", bytes_of(fake.path() / "normal.npy")}}, true));
      std::filesystem::remove(fake.path() / "normal.npy");
    }
    const Capture capture = load_capture(fake.path(), {});
    ASSERT_EQ(capture.train.size(), 3U);
    expect_frame(capture, 0, 0);
    expect_frame(capture, 1, 2);
    expect_frame(capture, 2, 3);
  }
}

TEST(Priors, arrays_may_have_one_element_for_each_id) {
  InterpCapture fake(9);
  Tensor<float> array({9, 8, 12, 3});
  for (int64_t t = 0; t < 9; ++t) fill_frame(array, t);
  write_npy(fake.path() / "normal.npy", array);
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  expect_frame(capture, 1, 4);
  expect_frame(capture, 2, 8);
}

TEST(Priors, arrays_of_other_shapes_are_refused) {
  NerfDsCapture fake;
  fake.save();
  for (const Shape& shape : {Shape{3, 8, 12, 3}, Shape{4, 8, 12, 2}, Shape{8, 12, 3}, Shape{4, 0, 12, 3}}) {
    write_npy(fake.path() / "normal.npy", Tensor<float>(shape));
    EXPECT_THROW(load_capture(fake.path(), {}), InputError) << shape.to_string();
  }
}

TEST(Priors, arrays_of_other_proportions_are_told_of) {
  NerfDsCapture fake;
  fake.save();
  for (const int64_t width : {24, 16}) {
    write_npy(fake.path() / "normal.npy", Tensor<float>({4, 16, width, 3}));
    EXPECT_EQ(has_warning(load_capture(fake.path(), {}), "the normal prior of 000000_left, 000001_left"),
              width == 16);
  }
}

TEST(Priors, averages_are_unit_again_and_sizes_may_differ) {
  NerfDsCapture fake;
  Tensor<float> array({4, 4, 6, 3});
  for (int64_t i = 0; i < 4 * 24; ++i)
    store3(&array[3 * i], i % 2 == 0 ? Vec3<float>(0.6F, 0, 0.8F) : Vec3<float>(-0.6F, 0, 0.8F));
  write_npy(fake.path() / "normal.npy", array);
  fake.save();
  CaptureOptions options;
  options.downscale = 4;  // two of the prior's pixels a side
  const Capture capture = load_capture(fake.path(), options);
  const auto images = load_images(capture, capture.train[0]);
  ASSERT_EQ(images->normal_prior.shape(), (Shape{2, 3, 3}));
  for (int64_t i = 0; i < 6; ++i) {
    EXPECT_LT(length(load3<float>(&images->normal_prior[3 * i]) - Vec3<float>(0, 0, -1)), 1e-4);
  }
}

// A ball seen by two cameras: its points, and what an exact estimator says in the given axes.
struct Ball {
  Tensor<float> points{{3000, 3}};
  std::vector<PriorView> views;

  explicit Ball(const Vec3<double>& signs) {
    Random random(5);
    for (int64_t i = 0; i < points.dim(0); ++i) {
      Vec3<double> n;
      do n = Vec3<double>(random.normal(), random.normal(), random.normal());
      while (length(n) < 1e-3);
      store3(points.row(i), normalize(n) * (1 + 0.002 * random.normal()));
    }
    for (const double angle : {0.3, 1.9}) {
      Camera<float> camera;
      camera.width = camera.height = 64;
      camera.focal_x = camera.focal_y = 80;
      camera.centre_x = camera.centre_y = 32;
      const Vec3<double> z(std::sin(angle), 0, std::cos(angle)), y(0, 1, 0);
      camera.camera_from_world = Mat3<float>(transpose(Mat3<double>(cross(y, z), y, z)));
      camera.position = Vec3<float>(-4.0 * z);
      Tensor<float> normal({64, 64, 3});
      for (int64_t v = 0; v < 64; ++v) {
        for (int64_t u = 0; u < 64; ++u) {
          const auto ray = normalize(
              Vec3<double>(camera.ray_in_world(static_cast<float>(u) + 0.5F, static_cast<float>(v) + 0.5F)));
          const double b = dot(ray, Vec3<double>(camera.position)), square = b * b - 15;
          if (square < 0) continue;
          const Vec3<double> hit = Vec3<double>(camera.position) + (-b - std::sqrt(square)) * ray;
          store3(&normal(v, u, 0), signs * (Mat3<double>(camera.camera_from_world) * normalize(hit)));
        }
      }
      views.push_back({camera, std::move(normal)});
    }
  }
};

TEST(PriorAxesCheck, reads_each_axis_off_the_points) {
  for (const PriorAxes axes : {PriorAxes::opengl, PriorAxes::opencv, PriorAxes::stable_normal}) {
    const Ball ball(prior_axis_signs(axes));
    const AxisEvidence evidence = measure_prior_axes(ball.points, ball.views);
    EXPECT_GT(evidence.samples, 500);
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_GT(evidence.correlation[axis] * prior_axis_signs(axes)[axis], 0.9) << axis;
    }
    const AxisChoice found = choose_prior_axes(PriorAxes::automatic, evidence);
    EXPECT_EQ(found.axes, axes);
    EXPECT_EQ(found.warning.empty(), axes == PriorAxes::opengl) << found.warning;
    for (const PriorAxes asked : {PriorAxes::opengl, PriorAxes::opencv, PriorAxes::stable_normal}) {
      const AxisChoice kept = choose_prior_axes(asked, evidence);
      EXPECT_EQ(kept.axes, asked);
      EXPECT_EQ(kept.warning.empty(), asked == axes);
    }
  }
}

TEST(PriorAxesCheck, axes_that_no_convention_has_are_told) {
  const Ball ball({-1, 1, 1});
  const AxisChoice choice =
      choose_prior_axes(PriorAxes::automatic, measure_prior_axes(ball.points, ball.views));
  EXPECT_EQ(choice.axes, PriorAxes::opengl);
  EXPECT_NE(choice.warning.find("x- y+ z+"), std::string::npos) << choice.warning;
  EXPECT_NE(choice.warning.find("no known axes fit"), std::string::npos);
}

TEST(PriorAxesCheck, without_points_the_side_that_is_seen_decides_z) {
  for (const PriorAxes axes : {PriorAxes::opengl, PriorAxes::opencv}) {
    const Ball ball(prior_axis_signs(axes));
    const AxisEvidence evidence = measure_prior_axes({}, ball.views);
    EXPECT_EQ(evidence.correlation.x, 0);
    EXPECT_EQ(evidence.correlation.y, 0);
    EXPECT_EQ(choose_prior_axes(PriorAxes::automatic, evidence).axes, axes);
  }
}

TEST(PriorAxesCheck, noise_decides_nothing) {
  Ball ball({1, 1, 1});
  Random random(3);
  for (PriorView& view : ball.views) {
    for (int64_t i = 0; i < view.normal.size(); i += 3) {
      store3(&view.normal[i], normalize(Vec3<double>(random.normal(), random.normal(), random.normal())));
    }
  }
  const AxisChoice choice =
      choose_prior_axes(PriorAxes::automatic, measure_prior_axes(ball.points, ball.views));
  EXPECT_EQ(choice.axes, PriorAxes::opengl);
  EXPECT_TRUE(choice.warning.empty()) << choice.warning;
}

TEST(PriorAxesCheck, hostile_geometry_decides_nothing) {
  const Ball ball({1, 1, 1});
  Tensor<float> nowhere({500, 3});
  nowhere.fill(NAN);
  Tensor<float> one_place({500, 3});
  for (const Tensor<float>& points : {nowhere, one_place}) {
    const AxisEvidence evidence = measure_prior_axes(points, ball.views);
    for (int axis = 0; axis < 3; ++axis) EXPECT_TRUE(std::isfinite(evidence.correlation[axis]));
  }
  EXPECT_EQ(measure_prior_axes({}, {}).samples, 0);
}

TEST(PriorAxesCheck, a_capture_with_opencv_priors_is_loaded_as_such) {
  NerfDsCapture fake;
  Tensor<float> array({4, 8, 12, 3});
  for (int64_t i = 0; i < array.size() / 3; ++i) store3(&array[3 * i], Vec3<float>(0.6F, 0, -0.8F));
  write_npy(fake.path() / "normal.npy", array);
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_EQ(capture.prior_axes, PriorAxes::opencv);
  EXPECT_TRUE(has_warning(capture, "using opencv"));
  EXPECT_LT(length(load3<float>(load_images(capture, capture.train[0])->normal_prior.data()) -
                   Vec3<float>(0.6F, 0, -0.8F)),
            1e-4);
  CaptureOptions options;
  options.prior_axes = PriorAxes::opengl;
  const Capture asked = load_capture(fake.path(), options);
  EXPECT_EQ(asked.prior_axes, PriorAxes::opengl);
  EXPECT_TRUE(has_warning(asked, "opencv would fit"));
}

}  // namespace
}  // namespace traceflow
