#include "train/random_walk.h"

#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "base/random.h"

namespace traceflow {
namespace {

WalkTerms no_terms(int64_t height, int64_t width) {
  const Shape shape{height, width};
  return {Tensor<float>(shape), Tensor<float>(shape), Tensor<float>(shape), Tensor<float>(shape)};
}

// The minimiser by Gaussian elimination of the dense normal equations.
std::vector<double> solved(const WalkTerms& terms) {
  const int64_t width = terms.one.dim(1), count = terms.one.size();
  const auto n = static_cast<size_t>(count);
  std::vector<std::vector<double>> rows(n, std::vector<double>(n + 1));
  const auto join = [&](int64_t i, int64_t j, double weight) {
    const auto a = static_cast<size_t>(i), b = static_cast<size_t>(j);
    rows[a][a] += weight;
    rows[b][b] += weight;
    rows[a][b] -= weight;
    rows[b][a] -= weight;
  };
  for (int64_t i = 0; i < count; ++i) {
    const auto a = static_cast<size_t>(i);
    rows[a][a] += static_cast<double>(terms.one[i]) + terms.zero[i];
    rows[a][n] += terms.one[i];
    if (i % width + 1 < width) join(i, i + 1, terms.right[i]);
    if (i + width < count) join(i, i + width, terms.down[i]);
  }
  for (size_t k = 0; k < n; ++k) {
    for (size_t i = 0; i < n; ++i) {
      if (i == k) continue;
      const double share = rows[i][k] / rows[k][k];
      for (size_t c = k; c <= n; ++c) rows[i][c] -= share * rows[k][c];
    }
  }
  std::vector<double> x(n);
  for (size_t k = 0; k < n; ++k) x[k] = rows[k][n] / rows[k][k];
  return x;
}

TEST(RandomWalk, SolvesTheNormalEquations) {
  Random random(7);
  for (const auto& [height, width] : {std::pair<int64_t, int64_t>{1, 1}, {1, 6}, {5, 1}, {7, 9}}) {
    WalkTerms terms = no_terms(height, width);
    for (int64_t i = 0; i < terms.one.size(); ++i) {
      terms.one[i] = random.uniform() < 0.3 ? static_cast<float>(random.uniform()) : 1e-4F;
      terms.zero[i] = random.uniform() < 0.3 ? static_cast<float>(random.uniform()) : 1e-4F;
      terms.right[i] = static_cast<float>(random.uniform());
      terms.down[i] = static_cast<float>(random.uniform());
    }
    const Tensor<float> x = random_walk(terms);
    const std::vector<double> expected = solved(terms);
    for (int64_t i = 0; i < x.size(); ++i) EXPECT_NEAR(x[i], expected[static_cast<size_t>(i)], 1e-4) << i;
  }
}

TEST(RandomWalk, CarriesEvidenceToWhereThereIsNone) {
  // One seed on each side of an edge that hardly joins them.
  WalkTerms terms = no_terms(1, 8);
  for (int64_t i = 0; i < 7; ++i) terms.right[i] = 1;
  terms.right[2] = 1e-4F;
  terms.one[0] = terms.zero[7] = 1;
  const Tensor<float> x = random_walk(terms);
  for (int64_t i = 0; i < 8; ++i) EXPECT_NEAR(x[i], i <= 2 ? 1 : 0, 1e-3) << i;
}

TEST(RandomWalk, IsZeroWhereNoEvidenceReaches) {
  WalkTerms terms = no_terms(1, 4);
  terms.one[0] = terms.right[0] = 1;
  const Tensor<float> x = random_walk(terms);
  EXPECT_NEAR(x[1], 1, 1e-5);
  EXPECT_EQ(x[2], 0);
  EXPECT_EQ(x[3], 0);
  EXPECT_EQ(random_walk(no_terms(2, 2))[0], 0);
}

}  // namespace
}  // namespace traceflow
