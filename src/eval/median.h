#pragma once

#include <algorithm>
#include <span>

#include "base/error.h"

namespace traceflow::eval {

// The median of at least one number, none of them NaN. Reorders the values. For an even count, the mean of
// the two middle values.
template <class T>
double median(std::span<T> values) {
  require(!values.empty(), "a median is of something");
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  const auto upper = static_cast<double>(*middle);
  if (values.size() % 2 == 1) return upper;
  return (static_cast<double>(*std::max_element(values.begin(), middle)) + upper) / 2;
}

}  // namespace traceflow::eval
