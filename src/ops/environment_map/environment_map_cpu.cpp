#include <span>
#include <vector>

#include "base/lists.h"
#include "base/parallel.h"
#include "ops/environment_map/environment_map.h"
#include "ops/environment_map/environment_map_kernels.h"

// Backward, rays are listed by where they look, and the map collects from the lists in their order: no two
// threads write to one texel, and the sum does not depend on their number. On the CPU a list and a collector
// is a row of texels, on the CUDA device one texel.
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

// Rays in the order of the map's rows that they look at, and in their own order within a row.
class RaysByRow {
 public:
  // texel: by ray, −1 for one that is left out.
  RaysByRow(const Tensor<int32_t>& texel, int64_t rows, int64_t size)
      : first_(static_cast<size_t>(rows) + 1) {
    for (const int32_t t : texel.values()) {
      if (t >= 0) first_[static_cast<size_t>(t / size) + 1] += 1;
    }
    for (size_t row = 0; row < static_cast<size_t>(rows); ++row) first_[row + 1] += first_[row];
    rays_.resize(static_cast<size_t>(first_.back()));
    std::vector<int32_t> next(first_.begin(), first_.end() - 1);
    for (int64_t ray = 0; ray < texel.size(); ++ray) {
      if (texel[ray] >= 0) {
        rays_[static_cast<size_t>(next[static_cast<size_t>(texel[ray] / size)]++)] =
            static_cast<int32_t>(ray);
      }
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

template <class T>
Map<T> map_of(const Tensor<T>& logit) {
  return {logit.data(), logit.dim(1)};
}

// Adds to one row of the map what the rays between it and the row before it, and between it and the next,
// send back.
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
  colour.place(logit.device()).resize(directions.shape());
  parallel_for(logit.device(), "environment map: look up", directions.dim(0),
               LookUp<T>{map_of(logit), directions.data(), colour.data()});
}

template <class T>
void backward(const Tensor<T>& logit, const Tensor<T>& directions, const Tensor<T>& grad_colour,
              Tensor<T>& grad_logit, Tensor<T>& grad_directions) {
  check_shapes(logit, directions);
  require(grad_logit.shape() == logit.shape() && grad_colour.shape() == directions.shape() &&
              grad_directions.shape() == directions.shape(),
          "gradients have the shapes of their values", grad_colour.shape().to_string());
  const int64_t count = directions.dim(0);
  const int64_t size = logit.dim(1);
  static thread_local Tensor<T> grad_interpolated;
  static thread_local Tensor<int32_t> texel;
  grad_interpolated.place(logit.device()).resize(directions.shape());
  texel.place(logit.device()).resize({count});
  parallel_for(logit.device(), "environment map: backward by ray", count,
               BackwardByRay<T>{map_of(logit), directions.data(), grad_colour.data(),
                                grad_interpolated.data(), grad_directions.data(), texel.data()});
  if (logit.device() == Device::cuda) {
    static thread_local cuda::Lists rays;
    cuda::list_by_key(texel.data(), count, logit.dim(0) * size, rays);
    parallel_for(Device::cuda, "environment map: backward by texel", logit.dim(0) * size,
                 BackwardByTexel<T>{size, directions.data(), grad_interpolated.data(), rays.begin.data(),
                                    rays.entry.data(), grad_logit.data()});
    return;
  }
  const RaysByRow rays(texel, logit.dim(0), size);
  // Its address: each thread has a tensor of its own.
  const Tensor<T>* const interpolated = &grad_interpolated;
  parallel_for(
      "environment map: backward by row", logit.dim(0),
      [&, interpolated](int64_t row) { collect_row(row, rays, directions, *interpolated, grad_logit); }, 4);
}

template void forward(const Tensor<float>&, const Tensor<float>&, Tensor<float>&);
template void forward(const Tensor<double>&, const Tensor<double>&, Tensor<double>&);
template void backward(const Tensor<float>&, const Tensor<float>&, const Tensor<float>&, Tensor<float>&,
                       Tensor<float>&);
template void backward(const Tensor<double>&, const Tensor<double>&, const Tensor<double>&, Tensor<double>&,
                       Tensor<double>&);

}  // namespace traceflow::environment_map
