#include "scene/field.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace traceflow {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;

constexpr NetworkOptions small{
    .depth = 3, .width = 32, .skip = 2, .position_frequencies = 4, .time_frequencies = 2};

TEST(NetworkOptions, DefaultsAreThePapers) {
  const NetworkOptions paper;
  paper.validate();
  EXPECT_EQ(paper.depth, 8);
  EXPECT_EQ(paper.width, 256);
  EXPECT_EQ(paper.encoding_size(), 63 + 13);
  EXPECT_EQ(paper.layer_inputs(0), 76);
  EXPECT_EQ(paper.layer_inputs(4), 256);
  EXPECT_EQ(paper.layer_inputs(5), 76 + 256);
}

TEST(NetworkOptions, RefusesShapesThatCannotBe) {
  const auto refuses = [](void (*change)(NetworkOptions&)) {
    NetworkOptions shape = small;
    change(shape);
    EXPECT_THROW(shape.validate(), InputError);
  };
  refuses([](NetworkOptions& s) { s.depth = 0; });
  refuses([](NetworkOptions& s) { s.depth = 33; });
  refuses([](NetworkOptions& s) { s.width = 0; });
  refuses([](NetworkOptions& s) { s.width = 40; });
  refuses([](NetworkOptions& s) { s.width = 2048; });
  refuses([](NetworkOptions& s) { s.skip = 3; });
  refuses([](NetworkOptions& s) { s.skip = -1; });
  refuses([](NetworkOptions& s) { s.position_frequencies = 17; });
  refuses([](NetworkOptions& s) { s.time_frequencies = -1; });
}

TEST(MakeField, HasTheShapesOfItsOptions) {
  Random random(1);
  const Field field = make_field(small, 11, random);
  EXPECT_EQ(field.outputs(), 11);
  EXPECT_EQ(field.weight[0].shape(), (Shape{32, 32}));
  EXPECT_EQ(field.weight[1].shape(), (Shape{32, 32}));
  EXPECT_EQ(field.weight[2].shape(), (Shape{32, 64}));
  EXPECT_EQ(field.head_weight.shape(), (Shape{11, 32}));
  EXPECT_EQ(Field().outputs(), 0);
}

TEST(MakeField, StartsBoundedWithHeadsAtZero) {
  Random random(1);
  const Field field = make_field(small, 11, random);
  for (int layer = 0; layer < small.depth; ++layer) {
    const double bound = 1 / std::sqrt(small.layer_inputs(layer));
    double squares = 0;
    for (const float w : field.weight[layer].values()) {
      EXPECT_LE(std::abs(w), bound);
      squares += static_cast<double>(w) * static_cast<double>(w);
    }
    // A uniform number in ±b has variance b²/3.
    EXPECT_NEAR(squares / static_cast<double>(field.weight[layer].size()), bound * bound / 3,
                0.1 * bound * bound);
  }
  EXPECT_THAT(field.head_weight.values(), Each(0.0F));
  EXPECT_THAT(field.head_bias.values(), Each(0.0F));
}

TEST(MakeField, RepeatsWithItsSeed) {
  Random one(5), two(5), other(6);
  const Field a = make_field(small, 10, one), b = make_field(small, 10, two),
              c = make_field(small, 10, other);
  EXPECT_TRUE(
      std::equal(a.weight[1].values().begin(), a.weight[1].values().end(), b.weight[1].values().begin()));
  EXPECT_FALSE(
      std::equal(a.weight[1].values().begin(), a.weight[1].values().end(), c.weight[1].values().begin()));
}

TEST(Field, NamesEveryParameterInOrder) {
  Random random(1);
  const Field field = make_field({.depth = 2, .width = 16, .skip = 0}, 3, random);
  std::vector<std::string> names;
  int64_t numbers = 0;
  field.for_each([&](const std::string& name, const Tensor<float>& t) {
    names.push_back(name);
    numbers += t.size();
  });
  EXPECT_THAT(names, ElementsAre("weight0", "bias0", "weight1", "bias1", "head_weight", "head_bias"));
  EXPECT_EQ(numbers, 16 * 76 + 16 + 16 * 16 + 16 + 3 * 16 + 3);
}

TEST(Field, ConvertsAndZeroesInItsShape) {
  Random random(1);
  const Field field = make_field(small, 4, random);
  const BasicField<double> exact = convert<double>(field);
  EXPECT_EQ(exact.shape.width, small.width);
  EXPECT_EQ(exact.weight[2](3, 5), static_cast<double>(field.weight[2](3, 5)));
  const BasicField<double> zero = zeros_like<double>(field);
  EXPECT_EQ(zero.weight[2].shape(), field.weight[2].shape());
  EXPECT_EQ(zero.outputs(), 4);
  EXPECT_THAT(zero.bias[1].values(), Each(0.0));
}

}  // namespace
}  // namespace traceflow
