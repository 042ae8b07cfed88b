#pragma once

#include <array>

namespace traceflow::prepare {

// Homogeneous linear equations in nine unknowns, solved by least squares.
class Equations9 {
 public:
  // Adds the equation row · x = 0.
  void add(const std::array<double, 9>& row);
  // The unit x with the least sum of squared errors, by Jacobi rotations of the normal equations.
  std::array<double, 9> least() const;

 private:
  std::array<std::array<double, 9>, 9> normal_{};
};

}  // namespace traceflow::prepare
