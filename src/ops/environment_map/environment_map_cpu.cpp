#include <algorithm>
#include <type_traits>
#include <vector>

#include "base/parallel.h"
#include "ops/environment_map/environment_map.h"
#include "ops/environment_map/environment_map_cuda.h"
#include "ops/environment_map/environment_map_kernels.h"

// The backward pass sorts rays by the row of texels that they use. Each row of the map then sums over its
// rays in order. So no two threads write to the same texel, and the sum does not depend on the number of
// threads.
namespace traceflow::environment_map {

namespace {

template <class T>
void check_shapes(const Tensor<T>& logit, const Tensor<T>& directions) {
  require(
      logit.shape().rank() == 3 && logit.dim(1) >= 1 && logit.dim(0) == 6 * logit.dim(1) && logit.dim(2) == 3,
      "a cube map has 6·S×S×3 logits", logit.shape().to_string());
  require(directions.shape().rank() == 2 && directions.dim(1) == 3, "directions are R×3",
          directions.shape().to_string());
}

// Rays ordered by the row of the map that they use, then by their index.
class RaysByRow {
 public:
  // row_of_ray: −1 for a ray that is left out.
  RaysByRow(const std::vector<int32_t>& row_of_ray, int64_t rows) : first_(static_cast<size_t>(rows) + 1) {
    for (const int32_t row : row_of_ray) {
      if (row >= 0) first_[static_cast<size_t>(row) + 1] += 1;
    }
    for (size_t row = 0; row < static_cast<size_t>(rows); ++row) first_[row + 1] += first_[row];
    rays_.resize(static_cast<size_t>(first_.back()));
    std::vector<int32_t> next(first_.begin(), first_.end() - 1);
    for (size_t ray = 0; ray < row_of_ray.size(); ++ray) {
      if (row_of_ray[ray] < 0) continue;
      int32_t& place = next[static_cast<size_t>(row_of_ray[ray])];
      rays_[static_cast<size_t>(place++)] = static_cast<int32_t>(ray);
    }
  }
  std::span<const int32_t> operator[](int64_t row) const {
    const auto begin = static_cast<size_t>(first_[static_cast<size_t>(row)]);
    const auto end = static_cast<size_t>(first_[static_cast<size_t>(row) + 1]);
    return {rays_.data() + begin, end - begin};
  }

 private:
  std::vector<int32_t> first_, rays_;
};

// Adds to one row of the map the gradients of the rays between it and the previous row, and of those between
// it and the next row.
template <class T>
void collect_row(int64_t row, const RaysByRow& rays, const Tensor<T>& directions,
                 const Tensor<T>& grad_interpolated, Tensor<T>& grad_logit) {
  const int64_t size = grad_logit.dim(1);
  const auto add = [&](int32_t ray, bool from_above) {
    const Lookup<T> l = look_up(load3<T>(directions.row(ray)), size);
    const T weight = from_above ? l.fraction_y : T(1) - l.fraction_y;
    const Vec3<T> g = weight * load3<T>(grad_interpolated.row(ray));
    add3(&grad_logit(row, l.column, 0), (T(1) - l.fraction_x) * g);
    add3(&grad_logit(row, l.next_column, 0), l.fraction_x * g);
  };
  if (row % size > 0) {
    for (const int32_t ray : rays[row - 1]) add(ray, true);
  }
  for (const int32_t ray : rays[row]) add(ray, false);
}

}  // namespace

template <class T>
void forward(const Tensor<T>& logit, const Tensor<T>& directions, Tensor<T>& colour) {
  check_shapes(logit, directions);
  colour.place(directions.device()).resize(directions.shape());
  parallel_for(directions.device(), "environment map: look up", directions.dim(0),
               LookUpColour<T>{{logit.data(), logit.dim(1)}, directions.data(), colour.data()});
}

template <class T>
void backward(const Tensor<T>& logit, const Tensor<T>& directions, const Tensor<T>& grad_colour,
              Tensor<T>& grad_logit, Tensor<T>& grad_directions) {
  check_shapes(logit, directions);
  require(grad_logit.shape() == logit.shape() && grad_colour.shape() == directions.shape() &&
              grad_directions.shape() == directions.shape(),
          "gradients have the shapes of their values", grad_colour.shape().to_string());
  const int64_t count = directions.dim(0);
  if constexpr (std::is_same_v<T, float>) {
    if (directions.device() == Device::cuda) {
      cuda::backward(logit, directions, grad_colour, grad_logit, grad_directions);
      return;
    }
  }
  const MapView<T> map{logit.data(), logit.dim(1)};
  Tensor<T> grad_interpolated(directions.shape());
  std::vector<int32_t> row_of_ray(static_cast<size_t>(count), -1);
  parallel_for("environment map: backward by ray", count, [&](int64_t i) {
    const Vec3<T> d = load3<T>(directions.row(i));
    if (!usable(d)) return;
    const RayGradient<T> g = ray_backward(map, d, load3<T>(grad_colour.row(i)));
    if (!is_finite(g.logit) || !is_finite(g.direction)) return;
    store3(grad_interpolated.row(i), g.logit);
    add3(grad_directions.row(i), g.direction);
    row_of_ray[static_cast<size_t>(i)] = static_cast<int32_t>(look_up(d, logit.dim(1)).row);
  });
  const RaysByRow rays(row_of_ray, logit.dim(0));
  parallel_for(
      "environment map: backward by row", logit.dim(0),
      [&](int64_t row) { collect_row(row, rays, directions, grad_interpolated, grad_logit); }, 4);
}

template void forward(const Tensor<float>&, const Tensor<float>&, Tensor<float>&);
template void forward(const Tensor<double>&, const Tensor<double>&, Tensor<double>&);
template void backward(const Tensor<float>&, const Tensor<float>&, const Tensor<float>&, Tensor<float>&,
                       Tensor<float>&);
template void backward(const Tensor<double>&, const Tensor<double>&, const Tensor<double>&, Tensor<double>&,
                       Tensor<double>&);

}  // namespace traceflow::environment_map
