#pragma once

#include <cstdint>
#include <Eigen/Core>
#include <vector>

namespace traceflow {

// A symmetric positive definite matrix of blocks. Blocks more than `half_bandwidth` blocks from the diagonal
// are zero. Only the blocks on and below the diagonal are stored.
class BandMatrix {
 public:
  using Matrix = Eigen::MatrixXd;

  // sizes: the number of rows of each block.
  BandMatrix(std::vector<int64_t> sizes, int64_t half_bandwidth);

  int64_t blocks() const { return static_cast<int64_t>(sizes_.size()); }
  int64_t size() const { return first_.back(); }
  // The index of a block's first row.
  int64_t first(int64_t block) const { return first_[static_cast<size_t>(block)]; }
  // The block at row `row` and column `column`, row − half_bandwidth ≤ column ≤ row.
  Matrix& at(int64_t row, int64_t column);
  // Multiplies the diagonal.
  void damp(double factor);
  // Solves a x = b by Cholesky factorisation, in place: the factors replace the matrix, and x replaces b.
  void solve(Eigen::VectorXd& b);

 private:
  std::vector<int64_t> sizes_, first_;
  int64_t half_bandwidth_;
  std::vector<Matrix> blocks_;
};

}  // namespace traceflow
