#include "ops/loss/rigidity_cuda.h"

#include <limits>

#include "ops/loss/loss_kernels.h"
#include "ops/loss/rigidity_kernels.h"
#include "primitives/group_by_key.h"
#include "primitives/sum_kernels.h"

// Each edge is measured once for the term's mean, which scales the gradient, and once by each of its ends. An
// end sums the gradients of its own edges and of those whose far end it is, in the order of the edges. For
// this the edges that count are listed by their far end.
namespace traceflow::loss::cuda {

using traceflow::cuda::for_each_index;
using traceflow::cuda::sum_each_index;

// Named namespace: the steps are parameters of a weak function, which needs types with external linkage.
namespace rigidity_steps {

struct Cloud {
  const float *rest, *posed;
  const int32_t* subset;  // null: all
  const int32_t* neighbour;
  const float* distance2;
  int32_t* posed_at;  // 1 + the posed index of a stored surfel; 0 if it is not posed
  int32_t* far;       // the posed index of an edge's far end; −1 if the edge does not count
  int32_t k;
  float strain2;

  __device__ int64_t stored(int64_t i) const { return subset == nullptr ? i : int64_t{subset[i]}; }
  // Edge e, whose far end is j.
  __device__ Edge edge(int32_t e, int32_t j) const {
    const int64_t i = e / k, near = stored(i);
    const Ends ends{load3<float>(rest + 3 * stored(j)) - load3<float>(rest + 3 * near),
                    load3<float>(posed + 3 * int64_t{j}) - load3<float>(posed + 3 * i)};
    return measure(ends, std::sqrt(distance2[near * k + k - 1]), strain2);
  }
};

struct PlacePosed {
  Cloud cloud;
  __device__ void operator()(int64_t i) const {
    cloud.posed_at[cloud.stored(i)] = static_cast<int32_t>(i) + 1;
  }
};

struct MeasureEdge {
  Cloud cloud;
  __device__ CountedSum operator()(int64_t i) const {
    const auto e = static_cast<int32_t>(i);
    cloud.far[e] = -1;
    const int32_t stored_far = cloud.neighbour[cloud.stored(e / cloud.k) * cloud.k + e % cloud.k];
    const int32_t j = stored_far < 0 ? -1 : cloud.posed_at[stored_far] - 1;
    if (j < 0) return {};
    const Edge edge = cloud.edge(e, j);
    if (!edge.counts) return {};
    cloud.far[e] = j;
    return {static_cast<double>(edge.value), 1};
  }
};

struct CollectGradients {
  Cloud cloud;
  const int32_t *begin, *entry;  // the edges by their far end
  double weight;
  const Mean* mean;
  float *grad_rest, *grad_posed;

  __device__ void operator()(int64_t i) const {
    if (!(mean->count > 0)) return;
    const auto j = static_cast<int32_t>(i);
    const auto scale = static_cast<float>(weight / mean->count);
    const int32_t* const arriving = entry + begin[j];
    const int32_t count = begin[j + 1] - begin[j];
    Vec3<float> at_rest = load3<float>(grad_rest + 3 * cloud.stored(j));
    Vec3<float> posed = load3<float>(grad_posed + 3 * i);
    const auto add = [&](const Edge& edge, float by) {
      at_rest += by * edge.at_rest;
      posed += by * edge.posed;
    };
    int32_t a = 0;
    for (; a < count && arriving[a] < j * cloud.k; ++a) add(cloud.edge(arriving[a], j), -scale);
    for (int32_t e = j * cloud.k; e < (j + 1) * cloud.k; ++e) {
      if (cloud.far[e] >= 0) add(cloud.edge(e, cloud.far[e]), scale);
    }
    for (; a < count; ++a) add(cloud.edge(arriving[a], j), -scale);
    store3(grad_rest + 3 * cloud.stored(j), at_rest);
    store3(grad_posed + 3 * i, posed);
  }
};

}  // namespace rigidity_steps

void rigidity(const Tensor<float>& rest, const Tensor<float>& posed, const Tensor<int32_t>& subset,
              const Neighbours& edges, double strain, double weight, Tensor<float>& grad_rest,
              Tensor<float>& grad_posed, Mean* mean) {
  using namespace rigidity_steps;
  const int64_t count = posed.dim(0), k = edges.index.dim(1), all = count * k;
  require(all < std::numeric_limits<int32_t>::max(), "edges are counted in 32 bits", std::to_string(all));
  static thread_local Tensor<int32_t> posed_at, far;
  static thread_local traceflow::cuda::KeyGroups arriving;
  posed_at.place(Device::cuda).reset({rest.dim(0)});
  far.place(Device::cuda).resize({all});
  const Cloud cloud{rest.data(),
                    posed.data(),
                    subset.empty() ? nullptr : subset.data(),
                    edges.index.data(),
                    edges.distance2.data(),
                    posed_at.data(),
                    far.data(),
                    static_cast<int32_t>(k),
                    static_cast<float>(strain * strain)};
  for_each_index("loss: place posed surfels", count, PlacePosed{cloud});
  sum_each_index<CountedSum>("loss: rigidity edges", all, MeasureEdge{cloud}, MeanOverCounted{mean});
  traceflow::cuda::group_by_key(far.data(), all, count, arriving);
  for_each_index("loss: rigidity gradient", count,
                 CollectGradients{cloud, arriving.begin.data(), arriving.entry.data(), weight, mean,
                                  grad_rest.data(), grad_posed.data()});
}

}  // namespace traceflow::loss::cuda
