#include "viz/colour_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "files/eight_bit.h"
#include "viz/picture.h"

namespace traceflow::viz {
namespace {

std::array<int, 3> levels(ColourMap map, float value) {
  const Vec3<float> c = map_colour(map, value);
  return {to_8bit(c.x), to_8bit(c.y), to_8bit(c.z)};
}

void expect_near(std::array<int, 3> found, int rgb, const std::string& what) {
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(found[c], (rgb >> (16 - 8 * c)) & 255, 5) << what << ", channel " << c;
  }
}

// The quarters of each map, as other programs print them; between the stops is a straight line.
TEST(ColourMaps, AreThePublishedOnes) {
  struct Published {
    ColourMap map;
    std::array<int, 5> quarters;
  };
  for (const auto& [map, quarters] :
       {Published{ColourMap::viridis, {0x440154, 0x3B528B, 0x21908C, 0x5DC863, 0xFDE725}},
        Published{ColourMap::magma, {0x000004, 0x51127C, 0xB63679, 0xFB8861, 0xFCFDBF}},
        Published{ColourMap::turbo, {0x30123B, 0x28BBEC, 0xA2FC3C, 0xFB8022, 0x7A0403}}}) {
    for (size_t i = 0; i < quarters.size(); ++i) {
      const float value = 0.25F * static_cast<float>(i);
      expect_near(levels(map, value), quarters[i],
                  std::string(enum_names(map)[static_cast<size_t>(map)]) + " at " + std::to_string(value));
    }
  }
}

TEST(ColourMaps, GoOnWithoutJumpsAndStayInRange) {
  for (size_t m = 0; m < enum_names(ColourMap{}).size(); ++m) {
    const auto map = static_cast<ColourMap>(m);
    for (int i = 0; i <= 1000; ++i) {
      const Vec3<float> c = map_colour(map, static_cast<float>(i) / 1000);
      const Vec3<float> next = map_colour(map, static_cast<float>(i + 1) / 1000);
      EXPECT_LT(length(next - c), 0.01F) << m << " at " << i;
      EXPECT_GE(std::min({c.x, c.y, c.z}), 0.0F);
      EXPECT_LE(std::max({c.x, c.y, c.z}), 1.0F);
    }
  }
}

TEST(ColourMaps, BearAnyNumber) {
  constexpr float infinity = std::numeric_limits<float>::infinity();
  for (size_t m = 0; m < enum_names(ColourMap{}).size(); ++m) {
    const auto map = static_cast<ColourMap>(m);
    EXPECT_EQ(map_colour(map, -infinity), map_colour(map, 0));
    EXPECT_EQ(map_colour(map, infinity), map_colour(map, 1));
    EXPECT_EQ(map_colour(map, std::nanf("")), Vec3<float>(0));
  }
}

TEST(ColourMaps, AreCalledByName) {
  EXPECT_EQ(parse_colour_map("turbo"), ColourMap::turbo);
  for (const char* bad : {"", "Turbo", "jet"}) EXPECT_THROW(parse_colour_map(bad), InputError) << bad;
}

Tensor<float> row_of(std::initializer_list<float> numbers) {
  Tensor<float> row(Shape{1, static_cast<int64_t>(numbers.size())});
  std::copy(numbers.begin(), numbers.end(), row.data());
  return row;
}

std::array<int, 3> pixel(const Tensor<uint8_t>& picture, int64_t j) {
  return {picture(0, j, 0), picture(0, j, 1), picture(0, j, 2)};
}

TEST(PaintOptions, AMapIsForEveryLayerOfNumbers) {
  Painter painter({.map = ColourMap::magma});
  const Tensor<float> values = row_of({0, 0.5F, 1, std::nanf("")});
  for (const Layer layer : {Layer::tint, Layer::alpha}) {
    const Tensor<uint8_t> picture = painter.paint(layer, values);
    EXPECT_EQ(pixel(picture, 0), levels(ColourMap::magma, 0));
    EXPECT_EQ(pixel(picture, 1), levels(ColourMap::magma, 0.5F));
    EXPECT_EQ(pixel(picture, 2), levels(ColourMap::magma, 1));
    EXPECT_EQ(pixel(picture, 3), (std::array{0, 0, 0}));
    EXPECT_EQ(Painter().paint(layer, values).shape(), values.shape()) << "grey by default";
  }
  // By inverse depth from 1/4 to 1.
  const Tensor<uint8_t> depth = painter.paint(Layer::depth, row_of({1, 2, 4, 0}));
  EXPECT_EQ(pixel(depth, 0), levels(ColourMap::magma, 1));
  EXPECT_EQ(pixel(depth, 1), levels(ColourMap::magma, 1.0F / 3));
  EXPECT_EQ(pixel(depth, 2), levels(ColourMap::magma, 0));
  EXPECT_EQ(pixel(depth, 3), (std::array{0, 0, 0})) << "none";
}

TEST(PaintOptions, ExposureDoublesLightWithEachStop) {
  Tensor<float> colour(Shape{1, 1, 3});
  colour[0] = 0.1F;
  colour[1] = 0.3F;
  colour[2] = 0.8F;
  for (const Layer layer : {Layer::rgb, Layer::diffuse, Layer::specular}) {
    EXPECT_EQ(pixel(Painter({.exposure = 1}).paint(layer, colour), 0),
              (std::array<int, 3>{to_8bit(0.2F), to_8bit(0.6F), 255}));
    EXPECT_EQ(pixel(Painter({.exposure = -1}).paint(layer, colour), 0)[2], to_8bit(0.4F));
  }
  for (const Layer layer : {Layer::normal, Layer::tint}) {
    const Tensor<float> values = layer == Layer::normal ? colour : row_of({0.1F, 0.3F});
    EXPECT_EQ(Painter({.exposure = 1}).paint(layer, values)[1], Painter().paint(layer, values)[1])
        << "is no light";
  }
}

TEST(PaintOptions, RangesFollowThePictureByShares) {
  Painter painter({.map = ColourMap::grey, .follow = 0.5F});
  painter.paint(Layer::distortion, row_of({0, 0, 0}));
  painter.paint(Layer::distortion, row_of({1, 2}));
  // From [1, 2] half of the way to [3, 8]: [2, 5], then [2.5, 6.5].
  EXPECT_EQ(painter.paint(Layer::distortion, row_of({3, 8}))(0, 0, 0), to_8bit(1.0F / 3));
  EXPECT_EQ(painter.paint(Layer::distortion, row_of({3, 8}))(0, 0, 0), to_8bit(0.125F));
  // A picture of nothing leaves the range where it is.
  painter.paint(Layer::distortion, row_of({0}));
  painter.options().follow = 0;
  EXPECT_EQ(painter.paint(Layer::distortion, row_of({3, 9}))(0, 0, 0), to_8bit(0.125F));
  painter.options().follow = 1;
  EXPECT_EQ(painter.paint(Layer::distortion, row_of({3, 9}))(0, 0, 0), 0);
}

TEST(Difference, IsTheMeanOfTheChannels) {
  Frame frame;
  frame.colour = Tensor<float>(Shape{1, 2, 3});
  Tensor<float> photograph(Shape{1, 2, 3});
  photograph(0, 1, 0) = 0.3F;
  frame.colour(0, 1, 2) = 0.06F;
  const Tensor<float> difference = difference_values(frame, photograph);
  ASSERT_EQ(difference.shape(), (Shape{1, 2}));
  EXPECT_EQ(difference[0], 0);
  EXPECT_NEAR(difference[1], 0.12F, 1e-6);
  const Tensor<uint8_t> picture = Painter({.map = ColourMap::grey}).paint_difference(difference);
  EXPECT_EQ(pixel(picture, 0)[0], 0);
  EXPECT_EQ(pixel(picture, 1)[0], to_8bit(0.48F));
  EXPECT_EQ(Painter({.map = ColourMap::grey, .exposure = 1}).paint_difference(difference)(0, 1, 0),
            to_8bit(0.96F));
  Tensor<uint8_t> known(Shape{1, 2});
  EXPECT_EQ(difference_values(frame, photograph, known)[1], 0);
  known[1] = 1;
  EXPECT_EQ(difference_values(frame, photograph, known)[1], difference[1]);
  EXPECT_THROW(difference_values(frame, Tensor<float>(Shape{2, 1, 3})), InternalError);
}

}  // namespace
}  // namespace traceflow::viz
