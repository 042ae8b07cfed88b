#pragma once

#include <gtest/gtest.h>

#include <cmath>

namespace traceflow {

// (f(x + h) - f(x - h)) / 2h in the number `parameter`, which f reads.
template <class F>
double central_difference(double& parameter, F&& f, double step = 1e-6) {
  const double kept = parameter;
  parameter = kept + step;
  const double above = f();
  parameter = kept - step;
  const double below = f();
  parameter = kept;
  return (above - below) / (2 * step);
}

// Expects an analytic derivative to agree with the central difference.
template <class F>
void expect_derivative(double analytic, double& parameter, F&& f, const char* what, double tolerance = 1e-7) {
  const double expected = central_difference(parameter, f);
  EXPECT_NEAR(analytic, expected, tolerance * (1 + std::abs(expected))) << what;
}

}  // namespace traceflow
