#pragma once

#include <array>

namespace traceflow::prepare {

// Homogeneous linear equations in nine unknowns, solved by least squares.
class Equations9 {
 public:
  // The equation row · x = 0.
  void add(const std::array<double, 9>& row);
  // The unit x whose sum of squared errors is least, by Jacobi rotations of the normal equations.
  std::array<double, 9> least() const;

 private:
  std::array<std::array<double, 9>, 9> normal_{};
};

}  // namespace traceflow::prepare
