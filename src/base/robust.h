#pragma once

#include <vector>

namespace traceflow {

// Of the two middle values the greater; 0 for none.
double median(std::vector<double> values);
// Standard deviation of a normal distribution with this median absolute deviation.
double robust_deviation(const std::vector<double>& values);

}  // namespace traceflow
