#include "train/random_walk.h"

#include <algorithm>
#include <vector>

namespace traceflow {

namespace {

// The matrix of the normal equations of an H×W grid.
class Grid {
 public:
  explicit Grid(const WalkTerms& terms)
      : terms_(terms),
        height_(terms.one.dim(0)),
        width_(terms.one.dim(1)),
        diagonal_(static_cast<size_t>(terms.one.size())) {
    for (int64_t i = 0; i < terms.one.size(); ++i)
      diagonal_[static_cast<size_t>(i)] = static_cast<double>(terms.one[i]) + terms.zero[i];
    each_edge([&](size_t i, size_t j, double weight) {
      diagonal_[i] += weight;
      diagonal_[j] += weight;
    });
  }

  const std::vector<double>& diagonal() const { return diagonal_; }

  void apply(const std::vector<double>& x, std::vector<double>& y) const {
    for (size_t i = 0; i < y.size(); ++i) y[i] = diagonal_[i] * x[i];
    each_edge([&](size_t i, size_t j, double weight) {
      y[i] -= weight * x[j];
      y[j] -= weight * x[i];
    });
  }

 private:
  template <class F>
  void each_edge(F&& f) const {
    for (int64_t y = 0; y < height_; ++y) {
      for (int64_t x = 0; x < width_; ++x) {
        const auto i = static_cast<size_t>(y * width_ + x);
        if (x + 1 < width_) f(i, i + 1, static_cast<double>(terms_.right(y, x)));
        if (y + 1 < height_) f(i, i + static_cast<size_t>(width_), static_cast<double>(terms_.down(y, x)));
      }
    }
  }

  const WalkTerms& terms_;
  int64_t height_, width_;
  std::vector<double> diagonal_;
};

double product(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

}  // namespace

Tensor<float> random_walk(const WalkTerms& terms) {
  constexpr int most_steps = 2000;
  constexpr double accuracy = 1e-10;  // relative to the first squared residual, in the preconditioner's norm
  const auto count = static_cast<size_t>(terms.one.size());
  const Grid grid(terms);
  const auto precondition = [&](const std::vector<double>& r, std::vector<double>& z) {
    for (size_t i = 0; i < count; ++i) z[i] = grid.diagonal()[i] > 0 ? r[i] / grid.diagonal()[i] : 0;
  };
  std::vector<double> x(count), r(count), z(count), p(count), q(count);
  for (size_t i = 0; i < count; ++i) r[i] = terms.one[static_cast<int64_t>(i)];
  precondition(r, z);
  p = z;
  double size = product(r, z);
  const double enough = accuracy * size;
  for (int step = 0; step < most_steps && size > enough; ++step) {
    grid.apply(p, q);
    const double along = size / product(p, q);
    for (size_t i = 0; i < count; ++i) {
      x[i] += along * p[i];
      r[i] -= along * q[i];
    }
    precondition(r, z);
    const double next = product(r, z);
    for (size_t i = 0; i < count; ++i) p[i] = z[i] + next / size * p[i];
    size = next;
  }
  Tensor<float> result(terms.one.shape());
  for (size_t i = 0; i < count; ++i)
    result[static_cast<int64_t>(i)] = static_cast<float>(std::clamp(x[i], 0.0, 1.0));
  return result;
}

}  // namespace traceflow
