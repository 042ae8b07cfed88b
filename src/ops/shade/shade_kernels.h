#pragma once

#include <cstdint>

#include "math/types.h"

// The steps of shading, for one traced pixel.
namespace traceflow::shade {

template <class T>
struct Blend {
  const int32_t* pixels;
  const T *diffuse, *tint, *specular;
  T* colour;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const int64_t pixel = pixels[i];
    const Vec3<T> d = load3<T>(diffuse + 3 * pixel);
    const Vec3<T> s = load3<T>(specular + 3 * i);
    store3(colour + 3 * pixel, (T(1) - tint[pixel]) * d + tint[pixel] * s);
  }
};

template <class T>
struct BlendBackward {
  const int32_t* pixels;
  const float* weights;
  const T *diffuse, *tint, *specular, *grad_colour;
  T *grad_diffuse, *grad_tint, *grad_specular;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const int64_t pixel = pixels[i];
    const T weight = static_cast<T>(weights[i]);
    const Vec3<T> d = load3<T>(diffuse + 3 * pixel);
    const Vec3<T> s = load3<T>(specular + 3 * i);
    const Vec3<T> g = load3<T>(grad_colour + 3 * pixel);
    store3(grad_diffuse + 3 * pixel, (T(1) - tint[pixel]) * g);
    store3(grad_specular + 3 * i, weight * tint[pixel] * g);
    grad_tint[pixel] += weight * dot(g, s - d);
  }
};

}  // namespace traceflow::shade
