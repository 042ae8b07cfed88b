#include "capture/lens/lens.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>

#include "base/error.h"
#include "base/random.h"
#include "capture/lens/resample.h"

namespace traceflow {
namespace {

// A lens as phones and action cameras have them; folding ones are left out by the callers' strength.
Lens random_lens(Random& random, double strength) {
  Lens lens;
  lens.width = 64;
  lens.height = 48;
  lens.focal = {random.uniform(50, 90), random.uniform(50, 90)};
  lens.centre = {random.uniform(28, 36), random.uniform(20, 28)};
  lens.skew = strength * random.uniform(-2, 2);
  lens.radial = strength * Vec3<double>(random.uniform(-0.2, 0.2), random.uniform(-0.1, 0.1),
                                        random.uniform(-0.05, 0.05));
  lens.tangential = strength * Vec2<double>(random.uniform(-0.01, 0.01), random.uniform(-0.01, 0.01));
  return lens;
}

// The camera of HyperNeRF's own test data, and a point that was projected with the formula of its
// documentation by hand: x = 0.3, y = -0.2, r² = 0.13, k = 1 + 0.1004·0.13 − 0.2091·0.13² = 1.00951821.
TEST(Lens, projects_as_the_capture_format_defines) {
  Lens lens{2448,           3264, {2691.17, 2691.17 * 1.00106}, {1221.0, 1652.5}, 2.0, {0.1004, -0.2091, 0},
            {0.003, -0.001}};
  const double k = 1 + 0.1004 * 0.13 - 0.2091 * 0.13 * 0.13;
  const double x = 0.3 * k + 2 * 0.003 * 0.3 * -0.2 - 0.001 * (0.13 + 2 * 0.09);
  const double y = -0.2 * k + 2 * -0.001 * 0.3 * -0.2 + 0.003 * (0.13 + 2 * 0.04);
  const Vec2<double> pixel = lens.pixel_from_ideal({0.3, -0.2});
  EXPECT_NEAR(pixel.x, 2691.17 * x + 2.0 * y + 1221.0, 1e-9);
  EXPECT_NEAR(pixel.y, 2691.17 * 1.00106 * y + 1652.5, 1e-9);
}

// Every term of the formula at once, over any projection.
Lens random_wide_lens(Random& random) {
  Lens lens = random_lens(random, 0.3);
  lens.radial_4 = random.uniform(-0.01, 0.01);
  lens.radial_below = 0.1 * Vec3<double>(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
  lens.prism = 0.01 * Vec4<double>(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1),
                                   random.uniform(-1, 1));
  lens.projection = static_cast<Projection>(random.below(3));
  lens.omega = random.uniform(0.01, 2.5);
  return lens;
}

RC_GTEST_PROP(Lens, jacobian_agrees_with_differences, (uint64_t seed)) {
  Random random(seed);
  const Lens lens = random_wide_lens(random);
  // The centre, and small radii where series take over, included.
  const double size = std::pow(10, random.uniform(-6, 0)) * static_cast<double>(random.below(8) > 0);
  const Vec2<double> at = size * Vec2<double>(random.uniform(-1, 1), random.uniform(-1, 1));
  const glm::dmat2 jacobian = lens.distort_jacobian(at);
  constexpr double h = 1e-6;
  for (int axis = 0; axis < 2; ++axis) {
    Vec2<double> step(0);
    step[axis] = h;
    const Vec2<double> slope = (lens.distort(at + step) - lens.distort(at - step)) / (2 * h);
    RC_ASSERT(length(slope - jacobian[axis]) < 1e-7);
  }
}

RC_GTEST_PROP(Lens, every_kind_undistorts_to_where_it_came_from, (uint64_t seed)) {
  Random random(seed);
  const Lens lens = random_wide_lens(random);
  const Vec2<double> ideal(random.uniform(-0.6, 0.6), random.uniform(-0.5, 0.5));
  RC_ASSERT(length(lens.ideal_from_pixel(lens.pixel_from_ideal(ideal)) - ideal) < 1e-9);
}

TEST(Lens, a_fisheye_places_angles_and_sees_nothing_in_front_beyond_90_degrees) {
  Lens lens{200, 200, {60, 60}, {100, 100}};
  lens.projection = Projection::equidistant;
  for (const double angle : {0.1, 0.7, 1.5}) {
    EXPECT_NEAR(lens.pixel_from_ideal({std::tan(angle), 0}).x, 100 + 60 * angle, 1e-9);
    EXPECT_NEAR(lens.ideal_from_pixel({100, 100 - 60 * angle}).y, -std::tan(angle), 1e-6);
  }
  EXPECT_TRUE(std::isnan(lens.ideal_from_pixel({100 + 60 * 1.6, 100}).x));
  EXPECT_EQ(lens.ideal_from_pixel({100, 100}), Vec2<double>(0));
  lens.projection = Projection::fov;
  lens.omega = 1;
  EXPECT_TRUE(std::isnan(lens.ideal_from_pixel({100 + 60 * 1.6, 100}).x));
}

TEST(Lens, any_term_but_zero_ends_being_a_pinhole) {
  const Lens pinhole{64, 48, {60, 50}, {32, 24}};
  EXPECT_TRUE(pinhole.is_pinhole());
  const auto with = [&](auto&& change) {
    Lens lens = pinhole;
    change(lens);
    return lens.is_pinhole();
  };
  for (int i = 0; i < 3; ++i) {
    EXPECT_FALSE(with([&](Lens& lens) { lens.radial[i] = 1e-9; }));
    EXPECT_FALSE(with([&](Lens& lens) { lens.radial_below[i] = 1e-9; }));
    EXPECT_FALSE(with([&](Lens& lens) { lens.prism[i] = 1e-9; }));
  }
  EXPECT_FALSE(with([](Lens& lens) { lens.prism[3] = 1e-9; }));
  EXPECT_FALSE(with([](Lens& lens) { lens.radial_4 = 1e-9; }));
  EXPECT_FALSE(with([](Lens& lens) { lens.tangential[1] = 1e-9; }));
  EXPECT_FALSE(with([](Lens& lens) { lens.skew = 1e-9; }));
  EXPECT_FALSE(with([](Lens& lens) { lens.projection = Projection::equidistant; }));
}

RC_GTEST_PROP(Lens, undistort_is_the_inverse_of_distort, (uint64_t seed)) {
  Random random(seed);
  const Lens lens = random_lens(random, 1);
  const Vec2<double> ideal(random.uniform(-0.6, 0.6), random.uniform(-0.5, 0.5));
  const Vec2<double> back = lens.undistort(lens.distort(ideal));
  RC_ASSERT(length(back - ideal) < 1e-9);
  const Vec2<double> from_pixel = lens.ideal_from_pixel(lens.pixel_from_ideal(ideal));
  RC_ASSERT(length(from_pixel - ideal) < 1e-9);
}

RC_GTEST_PROP(Lens, resizing_moves_pixels_in_proportion, (uint64_t seed)) {
  Random random(seed);
  const Lens lens = random_lens(random, 1);
  const Vec2<double> ideal(random.uniform(-0.6, 0.6), random.uniform(-0.5, 0.5));
  const Lens small = lens.resized(32, 12);
  const Vec2<double> expected = lens.pixel_from_ideal(ideal) * Vec2<double>(0.5, 0.25);
  RC_ASSERT(length(small.pixel_from_ideal(ideal) - expected) < 1e-9);
}

RC_GTEST_PROP(Zoom, every_pixel_of_the_pinhole_lies_in_the_photograph, (uint64_t seed)) {
  Random random(seed);
  const Lens lens = random_lens(random, 1);
  const double zoom = pinhole_zoom(lens, "test");
  RC_ASSERT(zoom >= 1 && zoom <= 2);
  for (double y = 0.5; y < lens.height; ++y) {
    for (double x = 0.5; x < lens.width; ++x) {
      const Vec2<double> at = lens.pixel_from_ideal((Vec2<double>(x, y) - lens.centre) / (zoom * lens.focal));
      RC_ASSERT(at.x > -0.02 && at.y > -0.02 && at.x < lens.width + 0.02 && at.y < lens.height + 0.02);
    }
  }
}

TEST(Zoom, is_one_for_a_barrel_and_no_more_than_needed_for_a_pincushion) {
  Lens lens{64, 48, {60, 60}, {32, 24}, 0, {-0.1, 0, 0}, {0, 0}};
  EXPECT_EQ(pinhole_zoom(lens, "test"), 1);
  lens.radial = {0.3, 0, 0};
  const double zoom = pinhole_zoom(lens, "test");
  EXPECT_GT(zoom, 1.01);
  // The worst place, a corner pixel, ends on the photograph's border.
  const Vec2<double> corner =
      lens.pixel_from_ideal((Vec2<double>(0.5, 0.5) - lens.centre) / (zoom * lens.focal));
  EXPECT_NEAR(std::min(corner.x, corner.y), 0, 1e-6);
}

TEST(Zoom, a_fisheye_has_a_pinhole_unless_it_is_absurdly_wide) {
  // An image circle of 220° inside the frame, as action cameras have it.
  Lens lens{200, 150, {100 / 1.92, 100 / 1.92}, {100, 75}};
  lens.projection = Projection::equidistant;
  EXPECT_EQ(pinhole_zoom(lens, "test"), 1);
  lens.focal = {15, 15};
  try {
    pinhole_zoom(lens, "camera 7");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("camera 7"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("80°"), std::string::npos) << error.what();
  }
}

TEST(Zoom, hostile_lenses_are_refused) {
  const double infinity = std::numeric_limits<double>::infinity();
  for (const Vec3<double>& radial :
       {Vec3<double>(-5, 0, 0), Vec3<double>(50, 0, 0), Vec3<double>(0, 0, 1e300), Vec3<double>(-1, 0.1, 0),
        Vec3<double>(infinity, 0, 0)}) {
    const Lens lens{64, 48, {30, 30}, {32, 24}, 0, radial, {0, 0}};
    EXPECT_THROW(pinhole_zoom(lens, "test"), InputError) << radial.x << " " << radial.y << " " << radial.z;
  }
  Lens pole{64, 48, {60, 60}, {32, 24}};
  pole.radial_below = {-10, 0, 0};
  EXPECT_THROW(pinhole_zoom(pole, "test"), InputError);
  const Lens outside{64, 48, {60, 60}, {-100, 24}, 0, {0.3, 0, 0}, {0, 0}};
  EXPECT_THROW(pinhole_zoom(outside, "test"), InputError);
}

// A smooth picture painted on the directions: what a camera of any lens sees of it is known in closed form.
float painted(const Vec2<double>& ideal, int channel) {
  return static_cast<float>(0.5 + 0.25 * std::sin(5 * ideal.x + channel) +
                            0.2 * std::cos(4 * ideal.y - 0.5 * channel));
}

RC_GTEST_PROP(Straighten, gives_what_a_pinhole_would_have_seen, (uint64_t seed)) {
  Random random(seed);
  Lens lens = random_lens(random, 1);
  if (random.below(2) == 1) {
    lens.projection = Projection::equidistant;
    lens.radial_4 = random.uniform(-0.02, 0.02);
  }
  const double zoom = pinhole_zoom(lens, "test");
  // A fisheye's pixels are wider apart near the border.
  const float coarse = lens.projection == Projection::equidistant ? 0.06F : 0.03F;
  Tensor<float> photograph({48, 64, 2});
  for (int64_t y = 0; y < 48; ++y) {
    for (int64_t x = 0; x < 64; ++x) {
      const Vec2<double> ideal =
          lens.ideal_from_pixel({static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5});
      for (int c = 0; c < 2; ++c) photograph(y, x, c) = painted(ideal, c);
    }
  }
  const Tensor<float> straight = straighten(photograph, lens, zoom);
  const Tensor<float> nearest = straighten_nearest(photograph, lens, zoom);
  for (int64_t y = 1; y < 47; ++y) {
    for (int64_t x = 1; x < 63; ++x) {
      const Vec2<double> pixel(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5);
      for (int c = 0; c < 2; ++c) {
        const float expected = painted((pixel - lens.centre) / (zoom * lens.focal), c);
        RC_ASSERT(std::abs(straight(y, x, c) - expected) < 0.01F);
        RC_ASSERT(std::abs(nearest(y, x, c) - expected) < coarse);
      }
    }
  }
}

TEST(Straighten, a_pinhole_without_zoom_changes_nothing) {
  const Lens lens{6, 4, {7, 9}, {2.5, 2}, 0, {0, 0, 0}, {0, 0}};
  ASSERT_TRUE(lens.is_pinhole());
  Tensor<float> image({4, 6, 1});
  Random random(1);
  for (float& v : image.values()) v = static_cast<float>(random.uniform());
  const Tensor<float> result = straighten(image, lens, 1);
  for (int64_t i = 0; i < image.size(); ++i) EXPECT_NEAR(result[i], image[i], 1e-6);
}

TEST(Resample, whole_steps_are_box_means_that_drop_the_remainder) {
  Tensor<float> image({5, 7, 2});
  for (int64_t i = 0; i < image.size(); ++i) image[i] = static_cast<float>((i * 37) % 101);
  const Tensor<float> small = resample(image, {3, 2, 2, 2});
  ASSERT_EQ(small.shape(), (Shape{2, 3, 2}));
  for (int64_t y = 0; y < 2; ++y)
    for (int64_t x = 0; x < 3; ++x)
      for (int64_t c = 0; c < 2; ++c) {
        const float mean = (image(2 * y, 2 * x, c) + image(2 * y, 2 * x + 1, c) + image(2 * y + 1, 2 * x, c) +
                            image(2 * y + 1, 2 * x + 1, c)) /
                           4;
        EXPECT_NEAR(small(y, x, c), mean, 1e-4);
      }
}

TEST(Resample, broken_steps_weigh_by_the_area_covered) {
  Tensor<float> image({1, 3, 1});
  for (int64_t i = 0; i < 3; ++i) image[i] = static_cast<float>(i + 1);
  const Tensor<float> two = resample(image, {2, 1, 1.5, 1});
  EXPECT_NEAR(two[0], (1 + 0.5 * 2) / 1.5, 1e-6);
  EXPECT_NEAR(two[1], (0.5 * 2 + 3) / 1.5, 1e-6);
}

TEST(Resample, enlarging_a_ramp_stays_a_ramp_inside) {
  Tensor<float> image({1, 4, 1});
  for (int64_t i = 0; i < 4; ++i) image[i] = static_cast<float>(i);
  const Tensor<float> eight = resample(image, {8, 1, 0.5, 1});
  const float expected[] = {0, 0.25F, 0.75F, 1.25F, 1.75F, 2.25F, 2.75F, 3};
  for (int i = 0; i < 8; ++i) EXPECT_NEAR(eight[i], expected[i], 1e-6);
}

TEST(Resample, a_constant_stays_constant_at_any_step) {
  Tensor<float> image({5, 7, 1});
  image.fill(0.625F);
  for (const double step : {0.3, 0.99, 1.0, 1.01, 1.7, 3.3, 100.0}) {
    const Tensor<float> result = resample(image, {4, 3, step, step});
    for (const float v : result.values()) EXPECT_NEAR(v, 0.625F, 1e-5) << step;
  }
}

}  // namespace
}  // namespace traceflow
