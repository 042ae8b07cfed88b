#include "base/robust.h"

#include <cmath>

namespace traceflow {

double median(std::vector<double> values) { return values.empty() ? 0 : ranked(values, values.size() / 2); }

double robust_deviation(const std::vector<double>& values) {
  const double middle = median(values);
  std::vector<double> distances;
  distances.reserve(values.size());
  for (const double v : values) distances.push_back(std::abs(v - middle));
  return 1.4826 * median(std::move(distances));
}

}  // namespace traceflow
