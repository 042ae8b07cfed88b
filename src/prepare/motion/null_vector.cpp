#include "prepare/motion/null_vector.h"

#include <cmath>
#include <cstddef>

namespace traceflow::prepare {

namespace {

constexpr size_t n = 9;
using Matrix = std::array<std::array<double, n>, n>;

// Rotates the plane of axes p and q so that a[p][q] becomes zero. v's columns accumulate the rotations.
void turn(Matrix& a, Matrix& v, size_t p, size_t q) {
  const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
  const double t = (theta >= 0 ? 1 : -1) / (std::abs(theta) + std::sqrt(theta * theta + 1));
  const double c = 1 / std::sqrt(t * t + 1), s = t * c;
  const auto mix = [c, s](double& x, double& y) {
    const double old = x;
    x = c * old - s * y;
    y = s * old + c * y;
  };
  for (size_t k = 0; k < n; ++k) mix(a[k][p], a[k][q]);
  for (size_t k = 0; k < n; ++k) mix(a[p][k], a[q][k]);
  for (size_t k = 0; k < n; ++k) mix(v[k][p], v[k][q]);
}

}  // namespace

void Equations9::add(const std::array<double, n>& row) {
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = 0; j < n; ++j) normal_[i][j] += row[i] * row[j];
  }
}

std::array<double, 9> Equations9::least() const {
  constexpr int sweeps = 20;
  Matrix a = normal_, v{};
  double trace = 0;
  for (size_t i = 0; i < n; ++i) {
    v[i][i] = 1;
    trace += a[i][i];
  }
  const double nothing = 1e-18 * trace;
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    bool done = true;
    for (size_t p = 0; p + 1 < n; ++p) {
      for (size_t q = p + 1; q < n; ++q) {
        if (!(std::abs(a[p][q]) > nothing)) continue;
        turn(a, v, p, q);
        done = false;
      }
    }
    if (done) break;
  }
  size_t smallest = 0;
  for (size_t i = 1; i < n; ++i) {
    if (a[i][i] < a[smallest][smallest]) smallest = i;
  }
  std::array<double, n> x{};
  for (size_t i = 0; i < n; ++i) x[i] = v[i][smallest];
  return x;
}

}  // namespace traceflow::prepare
