#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "math/types.h"

namespace traceflow {

// Normal equations of P numbers: a (P×P, row-major, lower triangle) and b.
struct NormalEquations {
  std::vector<double> a, b;

  explicit NormalEquations(size_t params) : a(params * params), b(params) {}
  // Adds one weighted residual. `row` has its derivatives by `count` consecutive numbers.
  template <size_t count>
  void add(size_t first, const std::array<double, count>& row, double residual, double share) {
    const size_t params = b.size();
    for (size_t p = 0; p < count; ++p) {
      for (size_t q = 0; q <= p; ++q) a[(first + p) * params + first + q] += share * row[p] * row[q];
      b[first + p] -= share * row[p] * residual;
    }
  }
};

}  // namespace traceflow
