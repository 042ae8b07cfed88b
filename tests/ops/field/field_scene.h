#pragma once

#include "math/encoding.h"
#include "math/types.h"
#include "scene/field.h"
#include "support/gradients.h"

namespace traceflow::testing {

// A field whose heads are not zero, unlike a new one's, so that gradients reach every layer.
inline Field random_field(const NetworkOptions& shape, int outputs, uint64_t seed = 7) {
  Random random(seed);
  Field field = make_field(shape, outputs, random);
  field.head_weight = random_tensor<float>(field.head_weight.shape(), random, -0.3, 0.3);
  field.head_bias = random_tensor<float>(field.head_bias.shape(), random, -0.3, 0.3);
  return field;
}

inline Tensor<float> random_points(int64_t count, uint64_t seed = 3) {
  Random random(seed);
  return random_tensor<float>({count, 3}, random, -1.5, 1.5);
}

// Zeroes the rows of grad_output whose points come so near to a kink of a ReLU that fp32 may see its other
// side.
inline void keep_away_from_kinks(const Field& field, const Tensor<float>& points, double time,
                                 Tensor<float>& grad_output) {
  const NetworkOptions& shape = field.shape;
  for (int64_t i = 0; i < points.dim(0); ++i) {
    std::vector<double> encoding(static_cast<size_t>(shape.encoding_size())), hidden;
    const Vec3<double> point = load3<double>(points.row(i));
    positional_encoding(&point[0], 3, shape.position_frequencies, encoding.data());
    positional_encoding(&time, 1, shape.time_frequencies,
                        encoding.data() + encoding_size(3, shape.position_frequencies));
    double nearest = 1;
    for (size_t layer = 0; layer < field.weight.size(); ++layer) {
      std::vector<double> input =
          layer == 0 || static_cast<int>(layer) == shape.skip ? encoding : std::vector<double>();
      input.insert(input.end(), hidden.begin(), hidden.end());
      hidden.assign(static_cast<size_t>(shape.width), 0.0);
      for (size_t o = 0; o < hidden.size(); ++o) {
        double sum = field.bias[layer][o];
        for (size_t k = 0; k < input.size(); ++k)
          sum += static_cast<double>(field.weight[layer](o, k)) * input[k];
        nearest = std::min(nearest, std::abs(sum));
        hidden[o] = std::max(sum, 0.0);
      }
    }
    if (nearest < 2e-6) std::fill_n(grad_output.row(i), grad_output.row_size(), 0.0F);
  }
}

// Every tensor's distance from the expected one is within `tolerance` of that one's length, and its length
// along that one within `bias`.
template <class A, class B>
void expect_fields_close(const BasicField<A>& found, const BasicField<B>& expected, double tolerance,
                         double bias) {
  std::vector<const Tensor<A>*> tensors;
  found.for_each([&](const std::string&, const Tensor<A>& t) { tensors.push_back(&t); });
  size_t next = 0;
  expected.for_each([&](const std::string& name, const Tensor<B>& t) {
    const Tensor<A>& other = *tensors[next++];
    ASSERT_EQ(other.shape(), t.shape()) << name;
    double distance = 0;
    for (int64_t i = 0; i < t.size(); ++i) {
      distance += std::pow(static_cast<double>(other[i]) - static_cast<double>(t[i]), 2);
    }
    const double length = std::sqrt(dot(t, t));
    ASSERT_GT(length, 0) << name;
    EXPECT_LT(std::sqrt(distance), tolerance * length) << name;
    EXPECT_NEAR(dot(other, t) / (length * length), 1, bias) << name;
  });
}

inline std::vector<Tensor<float>> tensors_of(const Field& field) {
  std::vector<Tensor<float>> all;
  field.for_each([&](const std::string&, const Tensor<float>& t) { all.push_back(t); });
  return all;
}

inline bool same_bytes(const Tensor<float>& a, const Tensor<float>& b) {
  return a.shape() == b.shape() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.values().size_bytes()) == 0);
}

inline bool same_bytes(const Field& a, const Field& b) {
  const std::vector<Tensor<float>> left = tensors_of(a), right = tensors_of(b);
  return std::equal(left.begin(), left.end(), right.begin(), right.end(),
                    [](const auto& x, const auto& y) { return same_bytes(x, y); });
}

}  // namespace traceflow::testing
