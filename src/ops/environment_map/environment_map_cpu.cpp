#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "base/parallel.h"
#include "math/cube_map.h"
#include "ops/environment_map/environment_map.h"

namespace traceflow::environment_map {

namespace {

// Directions per block; each block's share of the map's gradient is added in the order of blocks.
constexpr int64_t rays_per_block = 8192;

// The four texels around a direction and their weights.
template <class T>
struct Lookup {
  std::array<int64_t, 4>
      texel;  // index of the texel's first channel: top left, top right, bottom left, bottom right
  std::array<T, 4> weight;
  CubeCoordinates<T> at;
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
  const T cx = std::clamp(x, T(0), last);
  const T cy = std::clamp(y, T(0), last);
  const int64_t x0 = std::min(static_cast<int64_t>(cx), size - 2);
  const int64_t y0 = std::min(static_cast<int64_t>(cy), size - 2);
  l.fraction_x = cx - static_cast<T>(x0);
  l.fraction_y = cy - static_cast<T>(y0);
  const int64_t row = l.at.face * size + y0;
  l.texel = {3 * (row * size + x0), 3 * (row * size + x0 + 1), 3 * ((row + 1) * size + x0),
             3 * ((row + 1) * size + x0 + 1)};
  l.weight = {(1 - l.fraction_x) * (1 - l.fraction_y), l.fraction_x * (1 - l.fraction_y),
              (1 - l.fraction_x) * l.fraction_y, l.fraction_x * l.fraction_y};
  return l;
}

template <class T>
bool usable(const Vec3<T>& d) {
  return std::isfinite(d.x) && std::isfinite(d.y) && std::isfinite(d.z) &&
         (d.x != T(0) || d.y != T(0) || d.z != T(0));
}

template <class T>
Vec3<T> interpolated(const Tensor<T>& logit, const Lookup<T>& l) {
  Vec3<T> sum(T(0));
  for (size_t k = 0; k < 4; ++k) sum += l.weight[k] * load3<T>(logit.data() + l.texel[k]);
  return sum;
}

template <class T>
Vec3<T> logistic(const Vec3<T>& x) {
  return T(1) / (T(1) + exp(-x));
}

// Adds one ray's gradient to the texels' and returns the direction's.
template <class T>
Vec3<T> ray_backward(const Tensor<T>& logit, const Vec3<T>& direction, const Vec3<T>& grad_colour,
                     T* grad_logit) {
  const int64_t size = logit.dim(1);
  const Lookup<T> l = look_up(direction, size);
  const Vec3<T> colour = logistic(interpolated(logit, l));
  const Vec3<T> grad = grad_colour * colour * (T(1) - colour);
  std::array<T, 4> along{};
  for (size_t k = 0; k < 4; ++k) {
    add3(grad_logit + l.texel[k], l.weight[k] * grad);
    along[k] = dot(grad, load3<T>(logit.data() + l.texel[k]));
  }
  const T grad_x = (along[1] - along[0]) * (1 - l.fraction_y) + (along[3] - along[2]) * l.fraction_y;
  const T grad_y = (along[2] - along[0]) * (1 - l.fraction_x) + (along[3] - along[1]) * l.fraction_x;
  return cube_coordinates_backward(direction, l.at, l.inside_x ? grad_x * static_cast<T>(size) : T(0),
                                   l.inside_y ? grad_y * static_cast<T>(size) : T(0));
}

}  // namespace

template <class T>
void forward(const Tensor<T>& logit, const Tensor<T>& directions, Tensor<T>& colour) {
  colour.resize(directions.shape());
  parallel_for("environment map: look up", directions.dim(0), [&](int64_t i) {
    const Vec3<T> d = load3<T>(directions.row(i));
    const Vec3<T> c = usable(d) ? logistic(interpolated(logit, look_up(d, logit.dim(1)))) : Vec3<T>(T(0));
    store3(colour.row(i), c);
  });
}

template <class T>
void backward(const Tensor<T>& logit, const Tensor<T>& directions, const Tensor<T>& grad_colour,
              Tensor<T>& grad_logit, Tensor<T>& grad_directions) {
  const int64_t rays = directions.dim(0);
  std::vector<Tensor<T>> partial(static_cast<size_t>((rays + rays_per_block - 1) / rays_per_block));
  parallel_blocks("environment map: backward", rays, rays_per_block, [&](int64_t begin, int64_t end) {
    Tensor<T>& sum = partial[static_cast<size_t>(begin / rays_per_block)];
    sum.reset(logit.shape());
    for (int64_t i = begin; i < end; ++i) {
      const Vec3<T> d = load3<T>(directions.row(i));
      if (usable(d))
        add3(grad_directions.row(i), ray_backward(logit, d, load3<T>(grad_colour.row(i)), sum.data()));
    }
  });
  for (const Tensor<T>& sum : partial) {
    for (int64_t i = 0; i < sum.size(); ++i) grad_logit[i] += sum[i];
  }
}

template void forward(const Tensor<float>&, const Tensor<float>&, Tensor<float>&);
template void forward(const Tensor<double>&, const Tensor<double>&, Tensor<double>&);
template void backward(const Tensor<float>&, const Tensor<float>&, const Tensor<float>&, Tensor<float>&,
                       Tensor<float>&);
template void backward(const Tensor<double>&, const Tensor<double>&, const Tensor<double>&, Tensor<double>&,
                       Tensor<double>&);

}  // namespace traceflow::environment_map
