#include <algorithm>
#include <cmath>

#include "math/types.h"
#include "ops/loss/rigidity.h"

// The reference in double precision.
namespace traceflow::loss {

double rigidity_reference(const Tensor<double>& rest, const Tensor<double>& posed,
                          const Tensor<int32_t>& subset, const Neighbours& edges, double strain,
                          double weight, Tensor<double>& grad_rest, Tensor<double>& grad_posed) {
  const auto stored = [&](int64_t i) { return subset.empty() ? i : int64_t{subset[i]}; };
  const auto finite = [](const Vec3<double>& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
  };
  // Calls f(i, j, p, x, radius) for every edge that counts: the posed indices of its ends, its vectors at
  // rest and posed, and r_i.
  const auto for_each_edge = [&](auto&& f) {
    for (int64_t i = 0; i < posed.dim(0); ++i) {
      for (int64_t n = 0; n < edges.index.dim(1); ++n) {
        const int64_t far = edges.index(stored(i), n);
        for (int64_t j = 0; j < posed.dim(0); ++j) {
          if (far != stored(j)) continue;
          const Vec3<double> p = load3<double>(rest.row(far)) - load3<double>(rest.row(stored(i)));
          const Vec3<double> x = load3<double>(posed.row(j)) - load3<double>(posed.row(i));
          const double radius = std::sqrt(edges.distance2(stored(i), edges.index.dim(1) - 1));
          if (!finite(p) || !finite(x) || !(radius > 0) || length(p) == 0 || length(x) == 0) continue;
          f(i, j, p, x, radius);
        }
      }
    }
  };
  double sum = 0, counted = 0;
  for_each_edge([&](int64_t, int64_t, const Vec3<double>& p, const Vec3<double>& x, double radius) {
    const double e = (length(x) - length(p)) / radius;
    sum += e * e / (e * e + strain * strain);
    counted += 1;
  });
  if (counted == 0) return 0;
  for_each_edge([&](int64_t i, int64_t j, const Vec3<double>& p, const Vec3<double>& x, double radius) {
    const double e = (length(x) - length(p)) / radius;
    const double slope =
        weight / counted * 2 * e * strain * strain / std::pow(e * e + strain * strain, 2) / radius;
    add3(grad_posed.row(j), slope * x / length(x));
    add3(grad_posed.row(i), -slope * x / length(x));
    add3(grad_rest.row(stored(j)), -slope * p / length(p));
    add3(grad_rest.row(stored(i)), slope * p / length(p));
  });
  return sum / counted;
}

}  // namespace traceflow::loss
