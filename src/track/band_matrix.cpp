#include "track/band_matrix.h"

#include <algorithm>
#include <Eigen/Cholesky>
#include <utility>

#include "base/error.h"

namespace traceflow {

BandMatrix::BandMatrix(std::vector<int64_t> sizes, int64_t half_bandwidth)
    : sizes_(std::move(sizes)), first_(1, 0), half_bandwidth_(half_bandwidth) {
  for (const int64_t size : sizes_) first_.push_back(first_.back() + size);
  for (int64_t row = 0; row < blocks(); ++row) {
    for (int64_t back = 0; back <= half_bandwidth_; ++back) {
      const int64_t columns = back <= row ? sizes_[static_cast<size_t>(row - back)] : 0;
      blocks_.emplace_back(Matrix::Zero(sizes_[static_cast<size_t>(row)], columns));
    }
  }
}

BandMatrix::Matrix& BandMatrix::at(int64_t row, int64_t column) {
  return blocks_[static_cast<size_t>(row * (half_bandwidth_ + 1) + row - column)];
}

void BandMatrix::damp(double factor) {
  for (int64_t k = 0; k < blocks(); ++k) at(k, k).diagonal() *= factor;
}

void BandMatrix::solve(Eigen::VectorXd& b) {
  const int64_t count = blocks();
  const auto part = [&](int64_t block) {
    return b.segment(first(block), sizes_[static_cast<size_t>(block)]);
  };
  for (int64_t k = 0; k < count; ++k) {
    const int64_t last = std::min(count - 1, k + half_bandwidth_);
    const Eigen::LLT<Matrix> llt(at(k, k));
    at(k, k) = llt.matrixL();
    at(k, k).triangularView<Eigen::Lower>().solveInPlace(part(k));
    for (int64_t row = k + 1; row <= last; ++row) {
      at(k, k).transpose().triangularView<Eigen::Upper>().solveInPlace<Eigen::OnTheRight>(at(row, k));
      part(row) -= at(row, k) * part(k);
      for (int64_t column = k + 1; column <= row; ++column)
        at(row, column).noalias() -= at(row, k) * at(column, k).transpose();
    }
  }
  for (int64_t k = count; k-- > 0;) {
    for (int64_t row = k + 1; row <= std::min(count - 1, k + half_bandwidth_); ++row)
      part(k) -= at(row, k).transpose() * part(row);
    at(k, k).transpose().triangularView<Eigen::Upper>().solveInPlace(part(k));
  }
}

}  // namespace traceflow
