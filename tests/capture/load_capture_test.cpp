#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "capture/capture.h"
#include "capture/image_cache.h"
#include "fake_capture.h"
#include "files/npy.h"
#include "support/refusal.h"

namespace traceflow {
namespace {

std::vector<std::string> ids_of(const std::vector<View>& views) {
  std::vector<std::string> ids;
  ids.reserve(views.size());
  for (const View& view : views) ids.push_back(view.id);
  return ids;
}
using Ids = std::vector<std::string>;

TEST(Layouts, nerf_ds) {
  NerfDsCapture fake;
  fake.write_image("resized_mask/1x/000001_left.png.png", Tensor<uint8_t>({8, 12}));
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_EQ(capture.format, "nerf-ds");
  EXPECT_EQ(ids_of(capture.train), (Ids{"000000_left", "000001_left", "000002_left", "000003_left"}));
  EXPECT_EQ(ids_of(capture.test), (Ids{"000000_right", "000001_right", "000002_right", "000003_right"}));
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_FLOAT_EQ(capture.train[i].time, static_cast<float>(i) / 3);
    EXPECT_FLOAT_EQ(capture.test[i].time, static_cast<float>(i) / 3);
  }
  EXPECT_FLOAT_EQ(capture.near_plane, 0.1F);
  EXPECT_FLOAT_EQ(capture.far_plane, 2);
  EXPECT_TRUE(capture.has_masks);
  EXPECT_FALSE(capture.has_normal_priors);
  EXPECT_TRUE(has_warning(capture, "no points"));
  EXPECT_TRUE(has_warning(capture, "3 of 4 training views have no mask"));
  // Training cameras at x = 0, 0.2, 0.4, 0.6 in the capture: 0.3 from their mean, scaled by 0.5.
  EXPECT_NEAR(capture.extent, 1.1 * 0.3 * 0.5, 1e-6);
  // Black is the object.
  const auto images = load_images(capture, capture.train[1]);
  ASSERT_EQ(images->mask.shape(), (Shape{8, 12}));
  for (const uint8_t v : images->mask.values()) EXPECT_EQ(v, 1);
  EXPECT_TRUE(load_images(capture, capture.train[0])->mask.empty());
}

TEST(Layouts, hypernerf_vrig) {
  VrigCapture fake;
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_EQ(capture.format, "hypernerf-vrig");
  EXPECT_EQ(ids_of(capture.train), (Ids{"left1_000000", "right1_000001", "left1_000002", "right1_000003"}));
  EXPECT_EQ(ids_of(capture.test), (Ids{"right1_000000", "left1_000001", "right1_000002", "left1_000003"}));
  EXPECT_FLOAT_EQ(capture.test[3].time, 1);
}

TEST(Layouts, hypernerf_interp_trains_every_fourth_frame_and_tests_the_ones_between) {
  InterpCapture fake(9);
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_EQ(capture.format, "hypernerf-interp");
  EXPECT_EQ(ids_of(capture.train), (Ids{"000000", "000004", "000008"}));
  EXPECT_EQ(ids_of(capture.test), (Ids{"000002", "000006"}));
  EXPECT_FLOAT_EQ(capture.train[1].time, 0.5F);
  EXPECT_FLOAT_EQ(capture.test[1].time, 0.75F);
}

TEST(Layouts, hypernerf_interp_without_split_keys) {
  InterpCapture fake(9);
  fake.dataset.erase("train_ids");
  fake.dataset.erase("val_ids");
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_EQ(ids_of(capture.train), (Ids{"000000", "000004", "000008"}));
  EXPECT_EQ(ids_of(capture.test), (Ids{"000002", "000006"}));
}

TEST(Layouts, nerfies_has_warp_ids_and_the_old_key) {
  NerfiesCapture fake;
  for (auto& [id, camera] : fake.cameras) camera["tangential"] = {0.001, -0.002};
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_EQ(capture.format, "nerfies");
  EXPECT_EQ(ids_of(capture.train), (Ids{"000000", "000002", "000004"}));
  EXPECT_EQ(ids_of(capture.test), (Ids{"000001", "000003", "000005"}));
  EXPECT_FLOAT_EQ(capture.test[2].time, 1);
  EXPECT_FLOAT_EQ(capture.train[1].time, 0.4F);
  const ViewSource& source = capture.images->source("000000");
  EXPECT_EQ(source.lens.tangential, Vec2<double>(0.001, -0.002));
  EXPECT_FALSE(source.lens.is_pinhole());
}

TEST(Layouts, ids_may_be_numbers) {
  InterpCapture fake(0);
  for (int t = 0; t < 5; ++t) fake.add_view(std::to_string(t), t, t);
  fake.dataset = {{"ids", {0, 1, 2, 3, 4}}};
  fake.save();
  EXPECT_EQ(ids_of(load_capture(fake.path(), {}).train), (Ids{"0", "4"}));
}

TEST(Times, begin_with_the_first_view_wherever_the_film_was_cut) {
  NerfDsCapture fake;
  for (auto& [id, entry] : fake.metadata.items()) entry["time_id"] = 3000 + 10 * entry["time_id"].get<int>();
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  for (size_t i = 0; i < 4; ++i) EXPECT_FLOAT_EQ(capture.train[i].time, static_cast<float>(i) / 3);
  for (auto& [id, entry] : fake.metadata.items()) entry["time_id"] = 5;
  fake.save();
  const Capture still = load_capture(fake.path(), {});
  EXPECT_EQ(still.train[2].time, 0);
  EXPECT_TRUE(has_warning(still, "all training views are of one time"));
}

TEST(Cameras, that_single_precision_does_not_hold_are_refused) {
  NerfDsCapture fake;
  fake.cameras["000001_left"]["position"] = {1e12, 0.0, 0.0};
  fake.scene["scale"] = 1e9;
  fake.save();
  EXPECT_THAT(refusal_of([&] { load_capture(fake.path(), {}); }),
              testing::HasSubstr("camera/000001_left.json: position: found 1e+21 scene units"));
}

TEST(Cameras, are_normalised_and_keep_their_pixels) {
  NerfDsCapture fake;
  // A turn about z by 90°: x_camera = y_world, y_camera = -x_world.
  fake.cameras["000000_left"]["orientation"] = {{0, 1, 0}, {-1, 0, 0}, {0, 0, 1}};
  fake.cameras["000000_left"]["position"] = {1.0, 2.0, 3.0};
  fake.cameras["000000_left"]["focal_length"] = 20.0;
  fake.cameras["000000_left"]["pixel_aspect_ratio"] = 1.5;
  fake.cameras["000000_left"]["principal_point"] = {5.0, 3.5};
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  const Camera<float>& camera = capture.train[0].camera;
  EXPECT_EQ(camera.width, 12);
  EXPECT_EQ(camera.height, 8);
  EXPECT_FLOAT_EQ(camera.focal_x, 20);
  EXPECT_FLOAT_EQ(camera.focal_y, 30);
  EXPECT_FLOAT_EQ(camera.centre_x, 5);
  EXPECT_FLOAT_EQ(camera.centre_y, 3.5F);
  EXPECT_EQ(camera.position, Vec3<float>(0.5F, 1, 1));  // ((1, 2, 3) − (0, 0, 1)) · 0.5
  const Vec3<float> x = camera.point_in_camera(camera.position + Vec3<float>(1, 2, 5));
  EXPECT_EQ(x, Vec3<float>(2, -1, 5));
}

TEST(Cameras, follow_the_images_real_size) {
  InterpCapture fake(5);
  for (auto& [id, camera] : fake.cameras) {
    camera = FakeCapture::camera(24, 16);  // twice the stored images
    camera["focal_length"] = 30.0;
  }
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_EQ(capture.train[0].camera.width, 12);
  EXPECT_FLOAT_EQ(capture.train[0].camera.focal_x, 15);
  EXPECT_FLOAT_EQ(capture.train[0].camera.focal_y, 15);
  EXPECT_FLOAT_EQ(capture.train[0].camera.centre_x, 6);
  EXPECT_FLOAT_EQ(capture.train[0].camera.centre_y, 4);
}

TEST(Cameras, slightly_worn_rotations_are_restored) {
  InterpCapture fake(5);
  fake.cameras["000000"]["orientation"] = {{1.0001, 0, 0}, {0, 0.9999, 0.0001}, {0, 0, 1}};
  fake.save();
  const Mat3<double> rotation = load_capture(fake.path(), {}).images->source("000000").camera_from_world;
  const Mat3<double> product = transpose(rotation) * rotation;
  for (int i = 0; i < 9; ++i) EXPECT_NEAR(product[i / 3][i % 3], i % 4 == 0 ? 1 : 0, 1e-12);
}

TEST(Points, are_normalised_and_non_finite_ones_dropped) {
  NerfDsCapture fake;
  Tensor<float> points({3, 3});
  const float values[] = {0, 0, 2, NAN, 0, 1, 1, 2, 3};
  std::copy(std::begin(values), std::end(values), points.data());
  write_npy(fake.path() / "points.npy", points);
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  ASSERT_EQ(capture.points.shape(), (Shape{2, 3}));
  EXPECT_EQ(load3<float>(capture.points.row(0)), Vec3<float>(0, 0, 0.5F));
  EXPECT_EQ(load3<float>(capture.points.row(1)), Vec3<float>(0.5F, 1, 1));
  EXPECT_TRUE(has_warning(capture, "1 of 3 points are not finite"));
}

TEST(Points, in_other_coordinates_are_noticed) {
  NerfDsCapture fake;
  Tensor<float> points({50, 3});
  for (int64_t i = 0; i < 50; ++i) points(i, 2) = -100 - static_cast<float>(i);
  write_npy(fake.path() / "points.npy", points);
  fake.save();
  EXPECT_TRUE(has_warning(load_capture(fake.path(), {}), "hardly any point"));
}

TEST(Images, pinhole_photographs_are_not_touched) {
  NerfDsCapture fake;
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  const auto images = load_images(capture, capture.train[1]);
  ASSERT_EQ(images->colour.shape(), (Shape{8, 12, 3}));
  for (int64_t y = 0; y < 8; ++y)
    for (int64_t x = 0; x < 12; ++x)
      for (int64_t c = 0; c < 3; ++c) {
        EXPECT_EQ(images->colour(y, x, c), static_cast<float>(FakeCapture::colour(2, y, x, c)) / 255.0F);
      }
}

TEST(Images, grey_and_alpha_become_three_channels) {
  NerfDsCapture fake;
  Tensor<uint8_t> grey({8, 12}), rgba({8, 12, 4});
  for (int64_t i = 0; i < grey.size(); ++i) grey[i] = static_cast<uint8_t>(i);
  for (int64_t i = 0; i < rgba.size(); ++i) rgba[i] = static_cast<uint8_t>(i);
  fake.write_image("rgb/1x/000000_left.png", grey);
  fake.write_image("rgb/1x/000001_left.png", rgba);
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  const auto from_grey = load_images(capture, capture.train[0]),
             from_rgba = load_images(capture, capture.train[1]);
  for (int64_t i = 0; i < 96; ++i) {
    for (int64_t c = 0; c < 3; ++c) {
      EXPECT_EQ(from_grey->colour[3 * i + c], static_cast<float>(grey[i]) / 255.0F);
      const int over_black = (rgba[4 * i + c] * rgba[4 * i + 3] + 127) / 255;
      EXPECT_EQ(from_rgba->colour[3 * i + c], static_cast<float>(over_black) / 255.0F);
    }
  }
}

TEST(Images, of_sixteen_bits_are_rounded_and_stand_before_the_background) {
  NerfDsCapture fake;
  Tensor<uint16_t> rgb({8, 12, 3}), rgba({8, 12, 4});
  for (int64_t i = 0; i < rgb.size(); ++i) rgb[i] = static_cast<uint16_t>(i * 65535 / (rgb.size() - 1));
  for (int64_t i = 0; i < rgba.size(); ++i) rgba[i] = static_cast<uint16_t>(40503 * i);
  rgba[3] = 0;
  rgba[7] = 65535;
  write_png(fake.path() / "rgb/1x/000000_left.png", rgb);
  write_png(fake.path() / "rgb/1x/000001_left.png", rgba);
  fake.save();
  for (const auto& [background, level] : {std::pair{Background::automatic, 0.0},
                                          {Background::black, 0.0},
                                          {Background::grey, 128 / 255.0},
                                          {Background::white, 1.0}}) {
    CaptureOptions options;
    options.background = background;
    const Capture capture = load_capture(fake.path(), options);
    const auto from_rgb = load_images(capture, capture.train[0]),
               from_rgba = load_images(capture, capture.train[1]);
    for (int64_t i = 0; i < 96; ++i) {
      const double alpha = rgba[4 * i + 3] / 65535.0;
      for (int64_t c = 0; c < 3; ++c) {
        const auto nearest = static_cast<float>(std::lround(rgb[3 * i + c] / 257.0));
        EXPECT_EQ(from_rgb->colour[3 * i + c], nearest / 255.0F);
        const double seen = rgba[4 * i + c] / 65535.0 * alpha + level * (1 - alpha);
        // The colour, alpha and what is seen of both are rounded each.
        EXPECT_NEAR(from_rgba->colour[3 * i + c], seen, 1.51 / 255);
      }
    }
  }
}

TEST(Masks, of_motion_serve_where_there_is_none_of_the_object) {
  NerfDsCapture fake;
  Tensor<uint8_t> white({8, 12});
  white.fill(255);
  for (const char* id : {"000000_left", "000001_left"})
    fake.write_image("motion_mask/1x/" + std::string(id) + ".png.png", white);
  fake.save();
  const auto masks = [&](const Capture& capture) {
    std::vector<bool> result;
    for (int i : {0, 1})
      result.push_back(!load_images(capture, capture.train[static_cast<size_t>(i)])->mask.empty());
    return result;
  };
  const Capture estimated = load_capture(fake.path(), {});
  EXPECT_TRUE(estimated.has_masks && estimated.masks_are_estimated);
  EXPECT_EQ(masks(estimated), (std::vector<bool>{true, true}));
  fake.write_image("mask/1x/000001_left.png.png", white);
  const Capture given = load_capture(fake.path(), {});
  EXPECT_TRUE(given.has_masks && !given.masks_are_estimated);
  EXPECT_EQ(masks(given), (std::vector<bool>{false, true}));
}

TEST(Downscale, box_filters_the_largest_images_where_no_smaller_are_stored) {
  NerfDsCapture fake;
  Tensor<uint8_t> mask({8, 12});
  // 2×2 boxes with 0, 1, 2, 3 and 4 white pixels: from two on the box is the object.
  for (int64_t box = 0; box < 5; ++box) {
    for (int64_t k = 0; k < box; ++k) mask(k / 2, 2 * box + k % 2) = 255;
  }
  fake.write_image("mask/1x/000000_left.png.png", mask);
  fake.save();
  CaptureOptions options;
  options.downscale = 2;
  const Capture capture = load_capture(fake.path(), options);
  const Camera<float>& camera = capture.train[0].camera;
  EXPECT_EQ(camera.width, 6);
  EXPECT_EQ(camera.height, 4);
  EXPECT_FLOAT_EQ(camera.focal_x, 5);
  EXPECT_FLOAT_EQ(camera.centre_y, 2);
  const auto images = load_images(capture, capture.train[0]);
  for (int64_t y = 0; y < 4; ++y)
    for (int64_t x = 0; x < 6; ++x)
      for (int64_t c = 0; c < 3; ++c) {
        double sum = 0;
        for (int64_t k = 0; k < 4; ++k) sum += FakeCapture::colour(0, 2 * y + k / 2, 2 * x + k % 2, c);
        EXPECT_NEAR(255 * images->colour(y, x, c), sum / 4, 0.5 + 1e-4);
      }
  for (int64_t box = 0; box < 5; ++box) EXPECT_EQ(images->mask(0, box), box >= 2 ? 1 : 0) << box;
}

TEST(Downscale, takes_stored_images_and_filters_what_is_left) {
  NerfDsCapture fake;
  Tensor<uint8_t> half({4, 6, 3});
  for (int64_t i = 0; i < half.size(); ++i) half[i] = static_cast<uint8_t>(3 * i);
  for (const auto& [id, camera] : fake.cameras) fake.write_image("rgb/2x/" + id + ".png", half);
  fake.save();
  CaptureOptions options;
  options.downscale = 2;
  const Capture two = load_capture(fake.path(), options);
  EXPECT_EQ(load_images(two, two.train[0])->colour(1, 2, 1), static_cast<float>(half(1, 2, 1)) / 255.0F);
  options.downscale = 4;
  const Capture four = load_capture(fake.path(), options);
  EXPECT_EQ(four.train[0].camera.width, 3);
  EXPECT_FLOAT_EQ(four.train[0].camera.focal_x, 2.5F);
  const float mean = static_cast<float>(half(0, 0, 0) + half(0, 1, 0) + half(1, 0, 0) + half(1, 1, 0)) / 4;
  EXPECT_NEAR(255 * load_images(four, four.train[0])->colour(0, 0, 0), mean, 0.51);
}

TEST(Downscale, keeps_the_geometry_where_the_size_does_not_divide) {
  NerfDsCapture fake;
  fake.save();
  CaptureOptions options;
  options.downscale = 5;
  const Capture capture = load_capture(fake.path(), options);
  EXPECT_EQ(capture.train[0].camera.width, 2);
  EXPECT_EQ(capture.train[0].camera.height, 1);
  EXPECT_FLOAT_EQ(capture.train[0].camera.focal_y, 2);
  EXPECT_FLOAT_EQ(capture.train[0].camera.centre_x, 1.2F);
  EXPECT_EQ(load_images(capture, capture.train[0])->colour.shape(), (Shape{1, 2, 3}));
  options.downscale = 9;
  EXPECT_THROW(load_capture(fake.path(), options), InputError);
}

// The photograph by itself is what a capture of another size has.
TEST(Downscale, finer_photographs_are_those_of_finer_captures) {
  NerfDsCapture fake;
  Tensor<uint8_t> mask({8, 12});
  for (int64_t i = 0; i < mask.size(); i += 3) mask[i] = 255;
  fake.write_image("mask/1x/000000_left.png.png", mask);
  fake.save();
  CaptureOptions options;
  options.downscale = 4;
  const Capture coarse = load_capture(fake.path(), options);
  for (const auto& [widest, downscale] : {std::pair{100, 1}, {12, 1}, {11, 2}, {5, 3}, {1, 4}}) {
    options.downscale = downscale;
    const Capture fine = load_capture(fake.path(), options);
    const FinePhotograph photograph = load_fine_photograph(coarse, coarse.train[0], widest);
    const auto images = load_images(fine, fine.train[0]);
    EXPECT_TRUE(std::ranges::equal(photograph.colour.values(), images->colour.values())) << widest;
    EXPECT_TRUE(std::ranges::equal(photograph.coverage.values(), images->coverage.values())) << widest;
    const Camera<float>&found = photograph.camera, &expected = fine.train[0].camera;
    EXPECT_EQ(found.width, expected.width);
    EXPECT_EQ(found.height, expected.height);
    EXPECT_FLOAT_EQ(found.focal_x, expected.focal_x);
    EXPECT_FLOAT_EQ(found.focal_y, expected.focal_y);
    EXPECT_FLOAT_EQ(found.centre_x, expected.centre_x);
    EXPECT_FLOAT_EQ(found.centre_y, expected.centre_y);
    EXPECT_EQ(found.position, expected.position);
  }
}

TEST(Distortion, moves_the_camera_and_the_pixels_together) {
  // A wide grey wall with one bright spot in a known direction; the lens moves the spot, the straightened
  // view puts it where the view's pinhole says.
  InterpCapture fake(5);
  const Lens lens{120, 80, {100, 110}, {60, 40}, 0.5, {0.2, -0.1, 0.02}, {0.002, -0.003}};
  const Vec2<double> direction(0.35, -0.2);
  const Vec2<double> spot = lens.pixel_from_ideal(direction);
  Tensor<uint8_t> photograph({80, 120, 3}), mask({80, 120});
  for (int64_t y = 0; y < 80; ++y)
    for (int64_t x = 0; x < 120; ++x) {
      const double d2 = std::pow(static_cast<double>(x) + 0.5 - spot.x, 2) +
                        std::pow(static_cast<double>(y) + 0.5 - spot.y, 2);
      for (int64_t c = 0; c < 3; ++c)
        photograph(y, x, c) = static_cast<uint8_t>(std::lround(255 * std::exp(-d2 / 18)));
      mask(y, x) = d2 < 25 ? 255 : 0;
    }
  fake.write_image("rgb/1x/000000.png", photograph);
  fake.write_image("mask/1x/000000.png.png", mask);
  auto& camera = fake.cameras["000000"];
  camera = FakeCapture::camera(120, 80);
  camera["focal_length"] = 100.0;
  camera["pixel_aspect_ratio"] = 1.1;
  camera["skew"] = 0.5;
  camera["radial_distortion"] = {0.2, -0.1, 0.02};
  camera["tangential_distortion"] = {0.002, -0.003};
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  const auto images = load_images(capture, capture.train[0]);
  const Vec2<float> expected = capture.train[0].camera.project({0.35F, -0.2F, 1});
  Vec2<double> centre(0), mask_centre(0);
  double weight = 0, mask_weight = 0;
  for (int64_t y = 0; y < 80; ++y)
    for (int64_t x = 0; x < 120; ++x) {
      const Vec2<double> at(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5);
      centre += static_cast<double>(images->colour(y, x, 0)) * at;
      weight += images->colour(y, x, 0);
      mask_centre += static_cast<double>(images->mask(y, x)) * at;
      mask_weight += images->mask(y, x);
    }
  EXPECT_NEAR(centre.x / weight, expected.x, 0.2);
  EXPECT_NEAR(centre.y / weight, expected.y, 0.2);
  EXPECT_NEAR(mask_centre.x / mask_weight, expected.x, 0.3);
  EXPECT_NEAR(mask_centre.y / mask_weight, expected.y, 0.3);
  EXPECT_GT(length(Vec2<double>(expected) - spot), 1.5) << "the test's lens does something";
}

TEST(Incomplete, views_without_image_camera_or_time_are_left_out_with_a_warning) {
  NerfDsCapture fake;
  std::filesystem::remove(fake.path() / "rgb/1x/000001_left.png");
  fake.cameras.erase("000002_left");
  fake.metadata.erase("000000_right");
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_EQ(ids_of(capture.train), (Ids{"000000_left", "000003_left"}));
  EXPECT_EQ(ids_of(capture.test), (Ids{"000001_right", "000002_right", "000003_right"}));
  EXPECT_TRUE(has_warning(capture, "no image (000001_left)"));
  EXPECT_TRUE(has_warning(capture, "no camera (000002_left)"));
  EXPECT_TRUE(has_warning(capture, "no time in metadata.json (000000_right)"));
}

TEST(Incomplete, a_view_whose_entry_says_no_time_is_left_out_like_one_without_an_entry) {
  NerfDsCapture fake;
  fake.metadata["000001_left"] = {{"camera_id", 0}, {"appearance_id", 1}};
  fake.metadata["000003_left"] = FakeCapture::Json::object();
  fake.metadata["000002_right"] = nullptr;
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_EQ(ids_of(capture.train), (Ids{"000000_left", "000002_left"}));
  EXPECT_EQ(ids_of(capture.test), (Ids{"000000_right", "000001_right", "000003_right"}));
  EXPECT_TRUE(has_warning(
      capture, "2 of 4 training views have no time in metadata.json (000001_left, 000003_left): left out"));
  EXPECT_TRUE(has_warning(capture, "1 of 4 test views have no time in metadata.json (000002_right)"));
  EXPECT_FALSE(has_warning(capture, "no time_id"));
}

TEST(Incomplete, odd_data_is_told) {
  NerfDsCapture fake;
  fake.dataset["train_ids"].push_back("000000_left");
  fake.dataset["val_ids"].push_back("000001_left");
  fake.metadata["000003_left"].erase("time_id");
  fake.cameras["000002_left"]["image_size"] = {12, 12};
  fake.write_image("rgb/1x/000003_right.png", Tensor<uint8_t>({4, 6, 3}));
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_EQ(capture.train.size(), 4U);
  EXPECT_TRUE(has_warning(capture, "000000_left more than once"));
  EXPECT_TRUE(has_warning(capture, "000001_left in train_ids and in val_ids"));
  EXPECT_TRUE(has_warning(capture, "no time_id for 000003_left"));
  EXPECT_TRUE(has_warning(capture, "image_size of 000002_left"));
  EXPECT_TRUE(has_warning(capture, "2 different sizes"));
}

TEST(Incomplete, one_place_for_all_cameras_keeps_an_extent) {
  NerfDsCapture fake;
  for (auto& [id, camera] : fake.cameras) camera["position"] = {0, 0, 0};
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_EQ(capture.extent, 1);
  EXPECT_TRUE(has_warning(capture, "stand at one place"));
}

TEST(Truth, is_read_in_scene_units_and_on_the_views_grid) {
  NerfDsCapture fake;
  Tensor<uint8_t> normal({8, 12, 3});
  for (int64_t i = 0; i < 96; ++i) normal[3 * i] = 128, normal[3 * i + 1] = 128, normal[3 * i + 2] = 255;
  fake.write_image("truth/normal/000000_right.png", normal);
  Tensor<float> depth({8, 12});
  depth.fill(3);
  depth(0, 0) = 5;
  depth(0, 2) = INFINITY;
  depth(0, 3) = NAN;
  std::filesystem::create_directories(fake.path() / "truth/depth");
  write_npy(fake.path() / "truth/depth/000000_right.npy", depth);
  fake.save();
  CaptureOptions options;
  options.downscale = 2;
  const Capture capture = load_capture(fake.path(), options);
  EXPECT_TRUE(capture.has_truth);
  const ViewTruth truth = load_truth(capture, capture.test[0]);
  ASSERT_EQ(truth.normal.shape(), (Shape{4, 6, 3}));
  ASSERT_EQ(truth.depth.shape(), (Shape{4, 6}));
  EXPECT_NEAR(truth.depth(0, 0), 0.5 * (5 + 3 + 3 + 3) / 4, 1e-6);
  EXPECT_NEAR(truth.depth(0, 1), 0.5 * 3, 1e-6);
  EXPECT_NEAR(truth.normal(1, 1, 2), 1, 1e-4);
  EXPECT_NEAR(truth.normal(1, 1, 0), 0.004, 1e-3);
  EXPECT_TRUE(load_truth(capture, capture.test[1]).normal.empty());
}

// A view's prior is read as its truth is.
TEST(DepthPriors, are_read_like_true_depths) {
  NerfDsCapture fake;
  Tensor<float> depth({8, 12, 1});
  for (int64_t i = 0; i < depth.size(); ++i) depth[i] = static_cast<float>(i % 7) - 1;
  for (const char* folder : {"truth/depth", "depth/1x"}) {
    std::filesystem::create_directories(fake.path() / folder);
    write_npy(fake.path() / folder / "000000_left.npy", depth);
  }
  fake.save();
  CaptureOptions options;
  options.downscale = 2;
  const Capture capture = load_capture(fake.path(), options);
  EXPECT_TRUE(capture.has_depth_priors);
  const auto images = load_images(capture, capture.train[0]);
  const Tensor<float> expected = load_truth(capture, capture.train[0]).depth;
  ASSERT_EQ(images->depth_prior.shape(), expected.shape());
  EXPECT_EQ(images->depth_prior.values().size(), 24U);
  for (int64_t i = 0; i < 24; ++i) EXPECT_EQ(images->depth_prior[i], expected[i]);
  EXPECT_TRUE(load_images(capture, capture.train[1])->depth_prior.empty());
  const std::shared_ptr<const ViewPixels> pixels = load_pixels(capture, capture.train[0]);
  EXPECT_EQ(capture.images->bytes_of(capture.train[0].id), pixels->bytes());
  EXPECT_TRUE(std::ranges::any_of(capture.warnings, [](const Finding& finding) {
    return finding.kind == "missing-prior" && finding.text.find("depth") != std::string::npos;
  }));
}

TEST(DepthPriors, of_another_shape_are_refused_when_the_capture_is_opened) {
  NerfDsCapture fake;
  std::filesystem::create_directories(fake.path() / "depth/1x");
  write_npy(fake.path() / "depth/1x/000000_left.npy", Tensor<float>({8, 12, 3}));
  fake.save();
  EXPECT_THROW(load_capture(fake.path(), {}), InputError);
}

}  // namespace
}  // namespace traceflow
