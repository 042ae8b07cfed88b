#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace traceflow {

// The value that sorting would put at this place. Reorders the values.
template <class T>
T ranked(std::vector<T>& values, size_t place) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(place), values.end());
  return values[place];
}
// The median; for an even count the greater of the two middle values. 0 for no values.
double median(std::vector<double> values);
// Standard deviation of a normal distribution with this median absolute deviation.
double robust_deviation(const std::vector<double>& values);

}  // namespace traceflow
