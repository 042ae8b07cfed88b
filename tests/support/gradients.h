#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "base/tensor.h"

// What the tests of differentiable steps share.
namespace traceflow::testing {

// Uniform in [low, high).
template <class T>
Tensor<T> random_tensor(const Shape& shape, Random& random, double low, double high) {
  Tensor<T> tensor(shape);
  for (int64_t i = 0; i < tensor.size(); ++i) tensor[i] = static_cast<T>(random.uniform(low, high));
  return tensor;
}

template <class T>
std::vector<T> list_of(const Tensor<T>& tensor) {
  return {tensor.values().begin(), tensor.values().end()};
}

// d value() / d input[i] for every i; value reads `input`.
template <class T, class F>
Tensor<double> central_differences(Tensor<T>& input, F&& value, double step = 1e-5) {
  Tensor<double> gradient(input.shape());
  for (int64_t i = 0; i < input.size(); ++i) {
    const T kept = input[i];
    input[i] = static_cast<T>(kept + step);
    const double above = value();
    input[i] = static_cast<T>(kept - step);
    const double below = value();
    input[i] = kept;
    gradient[i] = (above - below) / (2 * step);
  }
  return gradient;
}

template <class A, class B>
double dot(const Tensor<A>& a, const Tensor<B>& b) {
  double sum = 0;
  for (int64_t i = 0; i < a.size(); ++i) sum += static_cast<double>(a[i]) * static_cast<double>(b[i]);
  return sum;
}

// Every entry agrees within `tolerance` of the largest expected magnitude, which must not be zero: a test
// that compares nothing with nothing is no test.
template <class A, class B>
void expect_close(const Tensor<A>& found, const Tensor<B>& expected, double tolerance, const char* what) {
  ASSERT_EQ(found.shape(), expected.shape()) << what;
  double largest = 0;
  for (const B v : expected.values()) largest = std::max(largest, std::abs(static_cast<double>(v)));
  ASSERT_GT(largest, 0) << what;
  for (int64_t i = 0; i < found.size(); ++i) {
    ASSERT_NEAR(static_cast<double>(found[i]), static_cast<double>(expected[i]), tolerance * largest)
        << what << " at " << i << " of " << found.shape().to_string();
  }
}

template <class T>
bool all_finite(const Tensor<T>& tensor) {
  return std::all_of(tensor.values().begin(), tensor.values().end(), [](T v) { return std::isfinite(v); });
}

// The bytes that `run` returns are the same at 1, 2, 3 and 4 threads. run: () → a vector of tensors.
template <class F>
void expect_same_bytes_at_any_thread_count(F&& run) {
  set_threads(1);
  const auto expected = run();
  for (int threads = 2; threads <= 4; ++threads) {
    set_threads(threads);
    const auto found = run();
    ASSERT_EQ(found.size(), expected.size());
    for (size_t i = 0; i < found.size(); ++i) {
      ASSERT_EQ(found[i].shape(), expected[i].shape());
      EXPECT_EQ(std::memcmp(found[i].data(), expected[i].data(), found[i].values().size_bytes()), 0)
          << "tensor " << i << " at " << threads << " threads";
    }
  }
  set_threads(0);
}

}  // namespace traceflow::testing
