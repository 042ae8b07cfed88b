#include "viz/picture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <limits>

#include "files/png.h"
#include "viz/contact_sheet.h"

namespace traceflow::viz {
namespace {

TEST(Layers, AreParsedOnceInTheGivenOrder) {
  EXPECT_EQ(parse_layers("normal,rgb,normal"), (std::vector{Layer::normal, Layer::rgb}));
  EXPECT_EQ(parse_layers("median-depth"), std::vector{Layer::median_depth});
  EXPECT_EQ(parse_layers("all").size(), layer_names.size());
  for (const char* bad : {"", ",", "rgb,colour", "RGB", "rgb,,normal", "rgb, normal"}) {
    EXPECT_THROW(parse_layers(bad), InputError) << bad;
  }
}

Frame small_frame() {
  Frame frame;
  frame.colour = Tensor<float>(Shape{2, 2, 3});
  frame.raster.colour = Tensor<float>(Shape{2, 2, 3});
  frame.raster.normal = Tensor<float>(Shape{2, 2, 3});
  for (Tensor<float>* plane : {&frame.raster.alpha, &frame.raster.tint, &frame.raster.depth,
                               &frame.raster.median_depth, &frame.raster.distortion}) {
    *plane = Tensor<float>(Shape{2, 2});
  }
  frame.specular_rays = Tensor<float>(Shape{0, 3});
  return frame;
}

TEST(Layers, DepthIsInTheCapturesUnits) {
  Frame frame = small_frame();
  frame.raster.depth(1, 0) = 3;
  EXPECT_EQ(layer_values(frame, Layer::depth, 0.5)(1, 0), 6);
  EXPECT_EQ(layer_values(frame, Layer::normal, 0.5).shape(), (Shape{2, 2, 3}));
  EXPECT_EQ(layer_values(frame, Layer::specular, 0.5).shape(), (Shape{2, 2, 3}));
}

TEST(Painter, NormalsBecomeColours) {
  Tensor<float> normal(Shape{1, 2, 3});
  normal(0, 0, 0) = 1;
  normal(0, 0, 2) = -1;
  const Tensor<uint8_t> picture = Painter().paint(Layer::normal, normal);
  EXPECT_EQ(picture(0, 0, 0), 255);
  EXPECT_EQ(picture(0, 0, 1), 128);
  EXPECT_EQ(picture(0, 0, 2), 0);
  EXPECT_EQ(picture(0, 1, 1), 0) << "black where there is none";
}

TEST(Painter, NearIsBrighterThanFarAndTheRangeStays) {
  Tensor<float> depth(Shape{1, 4});
  depth(0, 0) = 1;
  depth(0, 1) = 2;
  depth(0, 2) = 10;
  Painter painter;
  const Tensor<uint8_t> first = painter.paint(Layer::depth, depth);
  const auto brightness = [](const Tensor<uint8_t>& p, int64_t j) {
    return p(0, j, 0) + p(0, j, 1) + p(0, j, 2);
  };
  EXPECT_GT(brightness(first, 0), brightness(first, 1));
  EXPECT_GT(brightness(first, 1), brightness(first, 2));
  EXPECT_EQ(brightness(first, 3), 0);
  Tensor<float> later = depth;
  later(0, 0) = 0.1F;
  EXPECT_EQ(brightness(painter.paint(Layer::depth, later), 1), brightness(first, 1));
}

TEST(Painter, ShowsValuesThatAreNotFiniteAsNone) {
  Tensor<float> values(Shape{1, 3});
  values(0, 0) = std::numeric_limits<float>::quiet_NaN();
  values(0, 1) = std::numeric_limits<float>::infinity();
  for (const Layer layer : {Layer::depth, Layer::distortion}) {
    const Tensor<uint8_t> picture = Painter().paint(layer, values);
    for (int64_t i = 0; i < picture.size(); ++i) EXPECT_EQ(picture[i], 0);
  }
}

TEST(Shrink, AveragesBlocks) {
  Tensor<uint8_t> image(Shape{2, 4, 3});
  for (int64_t i = 0; i < 2; ++i) {
    for (int64_t j = 0; j < 4; ++j) image(i, j, 0) = static_cast<uint8_t>(j < 2 ? 10 * i : 200);
  }
  const Tensor<uint8_t> small = shrink(image, 2);
  ASSERT_EQ(small.shape(), (Shape{1, 2, 3}));
  EXPECT_EQ(small(0, 0, 0), 5);
  EXPECT_EQ(small(0, 1, 0), 200);
  EXPECT_EQ(shrink(image, 9).shape(), image.shape());
}

TEST(Shrink, FitsIntoTheHeightToo) {
  Tensor<uint8_t> tall(Shape{32768, 1, 3}), image(Shape{60, 40, 3});
  tall(0, 0, 1) = 200;
  for (const auto& [height, width] : {std::pair{30, 20}, {60, 10}, {15, 40}}) {
    const Shape fitted = shrink(image, width, height).shape();
    EXPECT_EQ(fitted, (Shape{std::min(height, 60 * width / 40), std::min(width, 40 * height / 60), 3}));
  }
  EXPECT_EQ(shrink(tall, 20, 64).shape(), (Shape{64, 1, 3}));
  EXPECT_EQ(shrink(tall, 20, 32768).shape(), tall.shape());
}

TEST(ContactSheet, HasNinePicturesARow) {
  const std::filesystem::path file =
      std::filesystem::temp_directory_path() / ("traceflow-sheet-" + std::to_string(::getpid()) + ".png");
  Frame frame = small_frame();
  frame.colour.fill(0.5F);
  frame.raster.alpha.fill(1);
  Tensor<float> photograph(Shape{2, 2, 3});
  photograph.fill(0.6F);
  ContactSheet sheet(100);
  sheet.add(photograph, frame, Tensor<uint8_t>(Shape{2, 2}));
  sheet.add(photograph, frame);
  sheet.write(file);
  const Tensor<uint8_t> picture = read_png(file);
  std::filesystem::remove(file);
  // As wide as "photograph", though the pictures are smaller.
  constexpr int64_t column_width = 80 + 3;
  ASSERT_EQ(picture.shape(), (Shape{16 + 2 * (2 + 3), 9 * column_width - 3, 3}));
  // The second row's photograph, render, difference (three times 0.1) and, last, alpha.
  const auto at = [&](int64_t column) { return int{picture(16 + 5, column * column_width, 1)}; };
  EXPECT_EQ(at(0), 153);
  EXPECT_EQ(at(1), 128);
  EXPECT_NEAR(at(2), 77, 1);
  EXPECT_EQ(at(8), 255);
  EXPECT_EQ(picture(16, 2 * column_width, 1), 0) << "of the first row's photograph nothing is known";
}

}  // namespace
}  // namespace traceflow::viz
