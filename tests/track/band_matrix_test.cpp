#include "track/band_matrix.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <Eigen/Dense>
#include <vector>

#include "base/random.h"

namespace traceflow {
namespace {

// Against a dense solver, for blocks of several sizes, empty ones among them.
TEST(BandMatrix, SolvesAsADenseOneDoes) {
  Random random(3);
  for (const int64_t reach : {0, 1, 3, 6}) {
    const std::vector<int64_t> sizes = {4, 1, 0, 5, 3, 2, 6};
    BandMatrix band(sizes, reach);
    const int64_t n = band.size();
    ASSERT_EQ(n, 21);
    // A sum of squares of rows that reach so far.
    Eigen::MatrixXd dense = Eigen::MatrixXd::Identity(n, n);
    for (int64_t block = 0; block + reach < band.blocks(); ++block) {
      for (int k = 0; k < 4; ++k) {
        Eigen::VectorXd row = Eigen::VectorXd::Zero(n);
        for (int64_t i = band.first(block); i < band.first(block + reach + 1); ++i) row[i] = random.normal();
        dense += row * row.transpose();
      }
    }
    for (int64_t row = 0; row < band.blocks(); ++row) {
      for (int64_t column = std::max<int64_t>(0, row - reach); column <= row; ++column)
        band.at(row, column) =
            dense.block(band.first(row), band.first(column), sizes[static_cast<size_t>(row)],
                        sizes[static_cast<size_t>(column)]);
    }
    dense.diagonal() *= 1.25;
    band.damp(1.25);
    Eigen::VectorXd b(n);
    for (int64_t i = 0; i < n; ++i) b[i] = random.normal();
    const Eigen::VectorXd expected = dense.ldlt().solve(b);
    band.solve(b);
    EXPECT_LT((b - expected).norm(), 1e-10 * expected.norm()) << reach;
  }
}

}  // namespace
}  // namespace traceflow
