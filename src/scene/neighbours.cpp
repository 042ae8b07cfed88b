#include "scene/neighbours.h"

#include <algorithm>
#include <nanoflann.hpp>

#include "base/parallel.h"

namespace traceflow {

namespace {

struct Cloud {
  const Tensor<float>& points;
  size_t kdtree_get_point_count() const { return static_cast<size_t>(points.dim(0)); }
  float kdtree_get_pt(size_t i, size_t axis) const {
    return points(static_cast<int64_t>(i), static_cast<int64_t>(axis));
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Cloud>, Cloud, 3>;

#if NANOFLANN_VERSION >= 0x150
using SearchParameters = nanoflann::SearchParameters;
#else
using SearchParameters = nanoflann::SearchParams;
#endif

}  // namespace

Neighbours nearest_neighbours(const Tensor<float>& points, int k) {
  const int64_t count = points.empty() ? 0 : points.dim(0);
  Neighbours result{Tensor<int32_t>({count, k}), Tensor<float>({count, k})};
  if (count == 0) return result;
  const Cloud cloud{points};
  const Tree tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(16));

  parallel_for("scene: nearest neighbours", count, [&](int64_t i) {
    // One more, since the point itself is among its neighbours.
    const auto wanted = static_cast<size_t>(k) + 1;
    std::vector<size_t> index(wanted);
    std::vector<float> distance2(wanted);
    nanoflann::KNNResultSet<float> found(wanted);
    found.init(index.data(), distance2.data());
    tree.findNeighbors(found, points.row(i), SearchParameters());
    int filled = 0;
    for (size_t j = 0; j < found.size() && filled < k; ++j) {
      if (index[j] == static_cast<size_t>(i)) continue;
      result.index(i, filled) = static_cast<int32_t>(index[j]);
      result.distance2(i, filled) = distance2[j];
      ++filled;
    }
    for (int j = filled; j < k; ++j) {
      result.index(i, j) = filled > 0 ? result.index(i, filled - 1) : -1;
      result.distance2(i, j) = filled > 0 ? result.distance2(i, filled - 1) : 0;
    }
  });
  return result;
}

Neighbours spread_neighbours(const Tensor<float>& points, int k, int stride) {
  const Neighbours all = nearest_neighbours(points, k * stride);
  const int64_t count = points.dim(0);
  Neighbours kept{Tensor<int32_t>({count, k}), Tensor<float>({count, k})};
  for (int64_t i = 0; i < count; ++i) {
    for (int n = 0; n < k; ++n) {
      kept.index(i, n) = all.index(i, (n + 1) * stride - 1);
      kept.distance2(i, n) = all.distance2(i, (n + 1) * stride - 1);
    }
  }
  return kept;
}

Tensor<int32_t> nearest_of(const Tensor<float>& points, const Tensor<float>& queries) {
  require(!points.empty(), "there is a point to be nearest", points.shape().to_string());
  const Cloud cloud{points};
  const Tree tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(16));
  Tensor<int32_t> nearest({queries.dim(0)});
  parallel_for("scene: nearest of", queries.dim(0), [&](int64_t i) {
    size_t index = 0;
    float distance2 = 0;
    nanoflann::KNNResultSet<float> found(1);
    found.init(&index, &distance2);
    tree.findNeighbors(found, queries.row(i), SearchParameters());
    nearest[i] = static_cast<int32_t>(index);
  });
  return nearest;
}

Neighbours nearest_of(const Tensor<float>& points, const Tensor<float>& queries, int k) {
  const int64_t count = queries.empty() ? 0 : queries.dim(0);
  Neighbours result{Tensor<int32_t>({count, k}), Tensor<float>({count, k})};
  std::fill_n(result.index.data(), result.index.size(), -1);
  if (count == 0 || points.empty()) return result;
  const Cloud cloud{points};
  const Tree tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(16));
  parallel_for("scene: nearest of", count, [&](int64_t i) {
    std::vector<size_t> index(static_cast<size_t>(k));
    std::vector<float> distance2(static_cast<size_t>(k));
    nanoflann::KNNResultSet<float> found(static_cast<size_t>(k));
    found.init(index.data(), distance2.data());
    tree.findNeighbors(found, queries.row(i), SearchParameters());
    for (size_t j = 0; j < found.size(); ++j) {
      result.index(i, static_cast<int64_t>(j)) = static_cast<int32_t>(index[j]);
      result.distance2(i, static_cast<int64_t>(j)) = distance2[j];
    }
  });
  return result;
}

}  // namespace traceflow
