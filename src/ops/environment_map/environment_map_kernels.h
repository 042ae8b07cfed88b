#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "math/cube_map.h"

// The steps of the lookup, for one ray or one texel.
namespace traceflow::environment_map {

// The four texels around a direction: rows row and next_row of the map (all faces stacked), columns column
// and next_column. At a clamped edge both are the same and the fraction is 0.
template <class T>
struct Lookup {
  CubeCoordinates<T> at;
  int64_t row, next_row, column, next_column;
  T fraction_x, fraction_y;
  bool inside_x, inside_y;  // false where the position is clamped at an edge
};

template <class T>
TRACEFLOW_HD Lookup<T> look_up(const Vec3<T>& direction, int64_t size) {
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
TRACEFLOW_HD bool usable(const Vec3<T>& direction) {
  return is_finite(direction) && direction != Vec3<T>(T(0));
}

// The address of the logits, on either device.
template <class T>
struct MapView {
  const T* logit;
  int64_t size;  // of a face

  TRACEFLOW_HD Vec3<T> texel(int64_t row, int64_t column) const {
    return load3<T>(logit + 3 * (row * size + column));
  }
};

// The four logits around a direction.
template <class T>
struct Corners {
  Vec3<T> top_left, top_right, bottom_left, bottom_right;

  TRACEFLOW_HD Corners(const MapView<T>& map, const Lookup<T>& l)
      : top_left(map.texel(l.row, l.column)),
        top_right(map.texel(l.row, l.next_column)),
        bottom_left(map.texel(l.next_row, l.column)),
        bottom_right(map.texel(l.next_row, l.next_column)) {}

  TRACEFLOW_HD Vec3<T> interpolated(T fx, T fy) const {
    const Vec3<T> top = (T(1) - fx) * top_left + fx * top_right;
    const Vec3<T> bottom = (T(1) - fx) * bottom_left + fx * bottom_right;
    return (T(1) - fy) * top + fy * bottom;
  }
  TRACEFLOW_HD Vec3<T> by_x(T fy) const {
    return (T(1) - fy) * (top_right - top_left) + fy * (bottom_right - bottom_left);
  }
  TRACEFLOW_HD Vec3<T> by_y(T fx) const {
    return (T(1) - fx) * (bottom_left - top_left) + fx * (bottom_right - top_right);
  }
};

template <class T>
TRACEFLOW_HD Vec3<T> logistic(const Vec3<T>& x) {
  return T(1) / (T(1) + exp(-x));
}

// The gradients of a ray: dL/d(interpolated logit) and dL/d(direction).
template <class T>
struct RayGradient {
  Vec3<T> logit, direction;
};

template <class T>
TRACEFLOW_HD RayGradient<T> ray_backward(const MapView<T>& map, const Vec3<T>& direction,
                                         const Vec3<T>& grad_colour) {
  const auto size = static_cast<T>(map.size);
  const Lookup<T> l = look_up(direction, map.size);
  const Corners<T> corners(map, l);
  const Vec3<T> colour = logistic(corners.interpolated(l.fraction_x, l.fraction_y));
  const Vec3<T> grad = grad_colour * colour * (T(1) - colour);
  const T grad_s = l.inside_x ? size * dot(grad, corners.by_x(l.fraction_y)) : T(0);
  const T grad_t = l.inside_y ? size * dot(grad, corners.by_y(l.fraction_x)) : T(0);
  return {grad, cube_coordinates_backward(direction, l.at, grad_s, grad_t)};
}

template <class T>
struct LookUpColour {
  MapView<T> map;
  const T* directions;
  T* colour;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const Vec3<T> d = load3<T>(directions + 3 * i);
    Vec3<T> c(T(0));
    if (usable(d)) {
      const Lookup<T> l = look_up(d, map.size);
      c = logistic(Corners<T>(map, l).interpolated(l.fraction_x, l.fraction_y));
    }
    store3(colour + 3 * i, c);
  }
};

// Sets the gradients of a ray and the first of its texels. That is one past the last texel of the map if the
// ray has no gradient.
template <class T>
struct RayStep {
  MapView<T> map;
  const T *directions, *grad_colour;
  T *grad_interpolated, *grad_directions;
  uint32_t *texel, *ray;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const Vec3<T> d = load3<T>(directions + 3 * i);
    ray[i] = static_cast<uint32_t>(i);
    texel[i] = static_cast<uint32_t>(6 * map.size * map.size);
    if (!usable(d)) return;
    const RayGradient<T> g = ray_backward(map, d, load3<T>(grad_colour + 3 * i));
    if (!is_finite(g.logit) || !is_finite(g.direction)) return;
    store3(grad_interpolated + 3 * i, g.logit);
    add3(grad_directions + 3 * i, g.direction);
    const Lookup<T> l = look_up(d, map.size);
    texel[i] = static_cast<uint32_t>(l.row * map.size + l.column);
  }
};

// Finds where the rays of texel i begin in the sorted list.
struct FindFirst {
  const uint32_t* texels;  // sorted
  int64_t rays;
  uint32_t* first;

  TRACEFLOW_HD void operator()(int64_t i) const {
    int64_t begin = 0;
    for (int64_t count = rays; count > 0;) {
      const int64_t half = count / 2;
      const bool before = static_cast<int64_t>(texels[begin + half]) < i;
      begin = before ? begin + half + 1 : begin;
      count = before ? count - half - 1 : half;
    }
    first[i] = static_cast<uint32_t>(begin);
  }
};

// Adds to texel i the gradients of the rays that use it: its own rays, and those of the three texels above
// and to the left.
template <class T>
struct CollectTexel {
  int64_t size;
  const uint32_t *first, *rays;  // sorted by texel
  const T *directions, *grad_interpolated;
  T* grad_logit;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const bool has_above = i / size % size > 0, has_left = i % size > 0;
    Vec3<T> sum(T(0));
    for (int above = 0; above <= (has_above ? 1 : 0); ++above) {
      for (int left = 0; left <= (has_left ? 1 : 0); ++left) {
        const int64_t texel = i - above * size - left;
        for (uint32_t k = first[texel]; k < first[texel + 1]; ++k) {
          const int64_t ray = rays[k];
          const Lookup<T> l = look_up(load3<T>(directions + 3 * ray), size);
          const T weight = (above != 0 ? l.fraction_y : T(1) - l.fraction_y) *
                           (left != 0 ? l.fraction_x : T(1) - l.fraction_x);
          sum += weight * load3<T>(grad_interpolated + 3 * ray);
        }
      }
    }
    add3(grad_logit + 3 * i, sum);
  }
};

}  // namespace traceflow::environment_map
