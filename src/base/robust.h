#pragma once

#include <vector>

namespace traceflow {

// The median; for an even count the greater of the two middle values. 0 for no values.
double median(std::vector<double> values);
// Standard deviation of a normal distribution with this median absolute deviation.
double robust_deviation(const std::vector<double>& values);

}  // namespace traceflow
