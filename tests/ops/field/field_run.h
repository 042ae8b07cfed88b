#pragma once

#include <limits>
#include <ostream>

#include "field_scene.h"
#include "ops/field/field.h"

// Both passes of a field on either device, and what either must survive.
namespace traceflow::testing {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();
constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr float test_time = 0.37F;

// Output and gradient of one forward and backward pass, on the host.
struct FieldPass {
  Tensor<float> output;
  Field gradient;
};

inline FieldPass run_field(Device device, const Field& field, const Tensor<float>& points,
                           const Tensor<float>& grad_output, field::Precision precision,
                           int64_t memory_limit = int64_t{1} << 29) {
  const Field there = field.on(device);
  const Tensor<float> points_there = points.on(device);
  FieldPass pass{{}, zeros_like<float>(there)};
  field::Saved saved;
  saved.memory_limit = memory_limit;
  field::forward(there, points_there, test_time, precision, pass.output, &saved);
  field::backward(there, points_there, test_time, saved, grad_output.on(device), pass.gradient);
  EXPECT_EQ(pass.output.device(), device);
  return {pass.output.on(Device::cpu), pass.gradient.on(Device::cpu)};
}

inline Tensor<float> random_gradient(int64_t count, int outputs) {
  Random random(17);
  return random_tensor<float>({count, outputs}, random, -1, 1);
}

struct FieldCase {
  NetworkOptions shape;
  int outputs;
  int64_t points;
};

inline std::ostream& operator<<(std::ostream& out, const FieldCase& c) {
  return out << "depth " << c.shape.depth << " width " << c.shape.width << " skip " << c.shape.skip
             << " octaves " << c.shape.position_frequencies << "+" << c.shape.time_frequencies << " outputs "
             << c.outputs << " points " << c.points;
}

inline Field doubled(Field field) {
  field.for_each([](const std::string&, Tensor<float>& t) {
    for (float& v : t.values()) v *= 2;
  });
  return field;
}

inline constexpr field::Precision both_precisions[] = {field::Precision::fp32, field::Precision::bf16};

inline void expect_finite(const FieldPass& pass) {
  EXPECT_TRUE(all_finite(pass.output));
  for (const auto& t : tensors_of(pass.gradient)) EXPECT_TRUE(all_finite(t));
}

// Bad points and bad gradients in the middle of good ones: their rows are zero, the other rows and the sums
// are those of a set in which they have no part.
inline void expect_bad_rows_poison_nothing(Device device, int64_t count) {
  const Field field = random_field({.depth = 4, .width = 64, .skip = 2}, 11);
  for (const field::Precision precision : both_precisions) {
    Tensor<float> points = random_points(count);
    Tensor<float> grad_output = random_gradient(count, 11);
    const Tensor<float> clean_output = run_field(device, field, points, grad_output, precision).output;
    Tensor<float> clean_gradient = grad_output;
    const float bad_values[] = {nan, infinity, -infinity, 1e30F, -2e6F, std::numeric_limits<float>::max()};
    std::vector<int64_t> bad;
    for (size_t k = 0; k < std::size(bad_values); ++k) {
      bad.push_back(count / 12 + static_cast<int64_t>(k) * count * 19 / 120);
      points(bad.back(), static_cast<int64_t>(k % 3)) = bad_values[k];
    }
    grad_output(7, 3) = nan;
    grad_output(count - 1, 0) = infinity;
    for (const int64_t i : bad) std::fill_n(clean_gradient.row(i), 11, 0.0F);
    for (const int64_t i : {int64_t{7}, count - 1}) std::fill_n(clean_gradient.row(i), 11, 0.0F);

    const FieldPass found = run_field(device, field, points, grad_output, precision);
    for (int64_t i = 0; i < count; ++i) {
      const bool is_bad = std::find(bad.begin(), bad.end(), i) != bad.end();
      for (int k = 0; k < 11; ++k) ASSERT_EQ(found.output(i, k), is_bad ? 0 : clean_output(i, k)) << i;
    }
    const FieldPass clean = run_field(device, field, points, clean_gradient, precision);
    EXPECT_TRUE(same_bytes(found.gradient, clean.gradient));
    expect_finite(found);
  }
}

inline void expect_finite_at_the_limit(Device device) {
  const Field field = random_field({.depth = 3, .width = 64, .skip = 2, .position_frequencies = 16}, 11);
  Tensor<float> points(Shape{3, 3});
  points(0, 0) = field::coordinate_limit;
  points(1, 1) = -field::coordinate_limit;
  points(2, 2) = std::numeric_limits<float>::denorm_min();
  for (const field::Precision precision : both_precisions) {
    expect_finite(run_field(device, field, points, random_gradient(3, 11), precision));
  }
}

inline void expect_nothing_of_no_points(Device device) {
  const Field field = random_field({.depth = 3, .width = 64, .skip = 2}, 11);
  for (const Tensor<float>& points : {Tensor<float>(), Tensor<float>(Shape{0, 3})}) {
    for (const field::Precision precision : both_precisions) {
      const FieldPass pass = run_field(device, field, points, Tensor<float>(Shape{0, 11}), precision);
      EXPECT_EQ(pass.output.shape(), (Shape{0, 11}));
      EXPECT_TRUE(same_bytes(pass.gradient, zeros_like<float>(field)));
    }
  }
}

// Parameters and a time that are not finite.
inline void expect_no_crash_where_broken(Device device) {
  Field field = random_field({.depth = 3, .width = 64, .skip = 2}, 11);
  const Tensor<float> points = random_points(10);
  field.weight[1](0, 0) = nan;
  field.weight[2](5, 5) = infinity;
  for (const field::Precision precision : both_precisions) {
    EXPECT_EQ(run_field(device, field, points, random_gradient(10, 11), precision).output.shape(),
              (Shape{10, 11}));
    Tensor<float> output;
    field::forward(field.on(device), points.on(device), nan, precision, output, nullptr);
    EXPECT_EQ(output.shape(), (Shape{10, 11}));
  }
}

}  // namespace traceflow::testing
