#include <algorithm>
#include <cmath>
#include <vector>

#include "base/parallel.h"
#include "math/cube_map.h"
#include "ops/environment_map/environment_map.h"

// Backward, rays are sorted by the row of texels that they look at, and each row of the map collects its own
// rays in their order: no two threads write to one texel, and the sum does not depend on their number.
namespace traceflow::environment_map {

namespace {

// The four texels around a direction: rows row, next_row of the map (all faces stacked), columns column,
// next_column. At a clamped edge both are the same and the fraction is 0.
template <class T>
struct Lookup {
  CubeCoordinates<T> at;
  int64_t row, next_row, column, next_column;
  T fraction_x, fraction_y;
  bool inside_x, inside_y;  // false where the clamped edge holds the position still
};

template <class T>
Lookup<T> look_up(const Vec3<T>& direction, int64_t size) {
  Lookup<T> l;
  l.at = cube_coordinates(direction);
  const T last = static_cast<T>(size - 1);
  const T x = l.at.s * static_cast<T>(size) - T(0.5);
  const T y = l.at.t * static_cast<T>(size) - T(0.5);
  l.inside_x = x > T(0) && x < last;
  l.inside_y = y > T(0) && y < last;
  const T clamped_x = std::clamp(x, T(0), last);
  const T clamped_y = std::clamp(y, T(0), last);
  l.column = static_cast<int64_t>(clamped_x);
  const auto row_in_face = static_cast<int64_t>(clamped_y);
  l.fraction_x = clamped_x - static_cast<T>(l.column);
  l.fraction_y = clamped_y - static_cast<T>(row_in_face);
  l.next_column = std::min(l.column + 1, size - 1);
  l.row = l.at.face * size + row_in_face;
  l.next_row = l.at.face * size + std::min(row_in_face + 1, size - 1);
  return l;
}

template <class T>
bool is_finite(const Vec3<T>& d) {
  return std::isfinite(d.x) && std::isfinite(d.y) && std::isfinite(d.z);
}

template <class T>
bool usable(const Vec3<T>& direction) {
  return is_finite(direction) && direction != Vec3<T>(T(0));
}

template <class T>
void check_shapes(const Tensor<T>& logit, const Tensor<T>& directions) {
  require(
      logit.shape().rank() == 3 && logit.dim(1) >= 1 && logit.dim(0) == 6 * logit.dim(1) && logit.dim(2) == 3,
      "a cube map has 6·S×S×3 logits", logit.shape().to_string());
  require(directions.shape().rank() == 2 && directions.dim(1) == 3, "directions are R×3",
          directions.shape().to_string());
}

// The four logits around a direction.
template <class T>
struct Corners {
  Vec3<T> top_left, top_right, bottom_left, bottom_right;

  Corners(const Tensor<T>& logit, const Lookup<T>& l)
      : top_left(load3<T>(&logit(l.row, l.column, 0))),
        top_right(load3<T>(&logit(l.row, l.next_column, 0))),
        bottom_left(load3<T>(&logit(l.next_row, l.column, 0))),
        bottom_right(load3<T>(&logit(l.next_row, l.next_column, 0))) {}

  Vec3<T> interpolated(T fx, T fy) const {
    const Vec3<T> top = (T(1) - fx) * top_left + fx * top_right;
    const Vec3<T> bottom = (T(1) - fx) * bottom_left + fx * bottom_right;
    return (T(1) - fy) * top + fy * bottom;
  }
  Vec3<T> by_x(T fy) const {
    return (T(1) - fy) * (top_right - top_left) + fy * (bottom_right - bottom_left);
  }
  Vec3<T> by_y(T fx) const {
    return (T(1) - fx) * (bottom_left - top_left) + fx * (bottom_right - top_right);
  }
};

template <class T>
Vec3<T> logistic(const Vec3<T>& x) {
  return T(1) / (T(1) + exp(-x));
}

// What a ray sends back: dL/d(interpolated logit) and dL/d(direction).
template <class T>
struct RayGradient {
  Vec3<T> logit, direction;
};

template <class T>
RayGradient<T> ray_backward(const Tensor<T>& logit, const Vec3<T>& direction, const Vec3<T>& grad_colour) {
  const auto size = static_cast<T>(logit.dim(1));
  const Lookup<T> l = look_up(direction, logit.dim(1));
  const Corners<T> corners(logit, l);
  const Vec3<T> colour = logistic(corners.interpolated(l.fraction_x, l.fraction_y));
  const Vec3<T> grad = grad_colour * colour * (T(1) - colour);
  const T grad_s = l.inside_x ? size * dot(grad, corners.by_x(l.fraction_y)) : T(0);
  const T grad_t = l.inside_y ? size * dot(grad, corners.by_y(l.fraction_x)) : T(0);
  return {grad, cube_coordinates_backward(direction, l.at, grad_s, grad_t)};
}

// Rays in the order of the map's rows that they look at, and in their own order within a row.
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
  colour.resize(directions.shape());
  parallel_for("environment map: look up", directions.dim(0), [&](int64_t i) {
    const Vec3<T> d = load3<T>(directions.row(i));
    Vec3<T> c(T(0));
    if (usable(d)) {
      const Lookup<T> l = look_up(d, logit.dim(1));
      c = logistic(Corners<T>(logit, l).interpolated(l.fraction_x, l.fraction_y));
    }
    store3(colour.row(i), c);
  });
}

template <class T>
void backward(const Tensor<T>& logit, const Tensor<T>& directions, const Tensor<T>& grad_colour,
              Tensor<T>& grad_logit, Tensor<T>& grad_directions) {
  check_shapes(logit, directions);
  require(grad_logit.shape() == logit.shape() && grad_colour.shape() == directions.shape() &&
              grad_directions.shape() == directions.shape(),
          "gradients have the shapes of their values", grad_colour.shape().to_string());
  const int64_t count = directions.dim(0);
  Tensor<T> grad_interpolated(directions.shape());
  std::vector<int32_t> row_of_ray(static_cast<size_t>(count), -1);
  parallel_for("environment map: backward by ray", count, [&](int64_t i) {
    const Vec3<T> d = load3<T>(directions.row(i));
    if (!usable(d)) return;
    const RayGradient<T> g = ray_backward(logit, d, load3<T>(grad_colour.row(i)));
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
