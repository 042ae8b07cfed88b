#include <cmath>
#include <vector>

#include "base/parallel.h"
#include "ops/loss/rigidity_cuda.h"
#include "ops/loss/rigidity_kernels.h"

namespace traceflow::loss {

namespace {

Mean rigidity_on_host(const Tensor<float>& rest, const Tensor<float>& posed, const Tensor<int32_t>& subset,
                      const Neighbours& edges, double strain, double weight, Tensor<float>& grad_rest,
                      Tensor<float>& grad_posed) {
  const int64_t k = edges.index.dim(1), count = posed.dim(0);
  const auto strain2 = static_cast<float>(strain * strain);
  const auto stored = [&](int64_t i) { return subset.empty() ? i : int64_t{subset[i]}; };
  std::vector<int32_t> posed_at(static_cast<size_t>(rest.dim(0)), -1);
  for (int64_t i = 0; i < count; ++i) posed_at[static_cast<size_t>(stored(i))] = static_cast<int32_t>(i);

  std::vector<Edge> measured(static_cast<size_t>(count * k));
  parallel_for("loss: rigidity edges", count, [&](int64_t i) {
    const int64_t near = stored(i);
    const Vec3<float> p = load3<float>(rest.row(near)), x = load3<float>(posed.row(i));
    const float radius = std::sqrt(edges.distance2(near, k - 1));
    for (int64_t n = 0; n < k; ++n) {
      const int32_t far = edges.index(near, n);
      const int32_t j = far < 0 ? -1 : posed_at[static_cast<size_t>(far)];
      if (j < 0) continue;
      const Ends ends{load3<float>(rest.row(far)) - p, load3<float>(posed.row(j)) - x};
      measured[static_cast<size_t>(i * k + n)] = measure(ends, radius, strain2);
    }
  });

  double sum = 0;
  int64_t counted = 0;
  for (const Edge& edge : measured) {
    sum += edge.value;
    counted += edge.counts ? 1 : 0;
  }
  if (counted == 0) return {0, 0};
  const auto scale = static_cast<float>(weight / static_cast<double>(counted));
  for (int64_t i = 0; i < count; ++i) {
    const int64_t near = stored(i);
    for (int64_t n = 0; n < k; ++n) {
      const Edge& edge = measured[static_cast<size_t>(i * k + n)];
      if (!edge.counts) continue;
      const int32_t far = edges.index(near, n);
      add3(grad_rest.row(near), scale * edge.at_rest);
      add3(grad_rest.row(far), -scale * edge.at_rest);
      add3(grad_posed.row(i), scale * edge.posed);
      add3(grad_posed.row(posed_at[static_cast<size_t>(far)]), -scale * edge.posed);
    }
  }
  return {sum / static_cast<double>(counted), static_cast<double>(counted)};
}

}  // namespace

void rigidity(const Tensor<float>& rest, const Tensor<float>& posed, const Tensor<int32_t>& subset,
              const Neighbours& edges, double strain, double weight, Tensor<float>& grad_rest,
              Tensor<float>& grad_posed, const MeanSlot& value) {
  Mean* const mean = value.on(posed.device());
  if (posed.device() == Device::cuda) {
    cuda::rigidity(rest, posed, subset, edges, strain, weight, grad_rest, grad_posed, mean);
  } else {
    *mean = rigidity_on_host(rest, posed, subset, edges, strain, weight, grad_rest, grad_posed);
  }
}

}  // namespace traceflow::loss
