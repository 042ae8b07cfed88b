#include <gtest/gtest.h>

#include "field_scene.h"
#include "ops/field/field.h"

namespace traceflow {
namespace {

using testing::central_differences;
using testing::dot;
using testing::expect_close;
using testing::random_field;
using testing::random_points;
using testing::random_tensor;

constexpr NetworkOptions small{
    .depth = 4, .width = 16, .skip = 2, .position_frequencies = 2, .time_frequencies = 1};

TEST(FieldReference, ComputesAHandMadeNetwork) {
  const NetworkOptions shape{
      .depth = 2, .width = 16, .skip = 1, .position_frequencies = 1, .time_frequencies = 1};
  BasicField<double> field = convert<double>(random_field(shape, 1));
  field.for_each([](const std::string&, Tensor<double>& t) { t.zero(); });
  // Encoding: x y z | sin x sin y sin z | cos x cos y cos z | t | sin t | cos t.
  field.weight[0](0, 4) = 2;  // h0 = relu(2 sin y + 0.5)
  field.bias[0][0] = 0.5;
  field.weight[0](1, 6) = -1;  // h1 = relu(-cos x) = 0 here
  field.weight[1](3, 11) = 1;  // g3 = relu(cos t + 3 h0 - 7 h1)
  field.weight[1](3, 12) = 3;
  field.weight[1](3, 13) = -7;
  field.head_weight(0, 3) = -2;
  field.head_bias[0] = 1;

  Tensor<double> points(Shape{1, 3});
  points(0, 0) = 0.3;
  points(0, 1) = 0.7;
  Tensor<double> output;
  field::forward_reference(field, points, 0.4, output);
  EXPECT_NEAR(output[0], 1 - 2 * (std::cos(0.4) + 3 * (2 * std::sin(0.7) + 0.5)), 1e-12);
}

TEST(FieldReference, BackwardMatchesCentralDifferencesInEveryParameter) {
  BasicField<double> field = convert<double>(random_field(small, 5));
  const Tensor<double> points = convert<double>(random_points(6));
  Random random(5);
  const auto weights = random_tensor<double>({6, 5}, random, -1, 1);
  BasicField<double> gradient = zeros_like<double>(field);
  field::backward_reference(field, points, 0.37, weights, gradient);

  std::vector<Tensor<double>*> parameters;
  field.for_each([&](const std::string&, Tensor<double>& t) { parameters.push_back(&t); });
  size_t i = 0;
  gradient.for_each([&](const std::string& name, const Tensor<double>& found) {
    const auto loss = [&] {
      Tensor<double> output;
      field::forward_reference(field, points, 0.37, output);
      return dot(output, weights);
    };
    expect_close(found, central_differences(*parameters[i++], loss, 1e-6), 1e-6, name.c_str());
  });
}

}  // namespace
}  // namespace traceflow
