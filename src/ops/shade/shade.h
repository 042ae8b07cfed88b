#pragma once

#include "base/tensor.h"

// Blends the diffuse and the specular image: C = (1 − α_spec)·C_diffuse + α_spec·C_specular (method §6). A
// pixel that is not traced has C = C_diffuse: when rendering, its α_spec is under the threshold of method
// §4.4.
namespace traceflow::shade {

// diffuse: H×W×3; tint: H×W; pixels: P indices of traced pixels, ascending; specular: P×3. colour: H×W×3,
// resized. Runs on the device of the images.
template <class T>
void forward(const Tensor<T>& diffuse, const Tensor<T>& tint, const Tensor<int32_t>& pixels,
             const Tensor<T>& specular, Tensor<T>& colour);

// Sets grad_diffuse (H×W×3) and grad_specular (P×3); adds to grad_tint (H×W). weights: P, each traced pixel's
// weight for the gradients of tint and specular (1/share for probes, method §4.4).
template <class T>
void backward(const Tensor<T>& diffuse, const Tensor<T>& tint, const Tensor<int32_t>& pixels,
              const Tensor<float>& weights, const Tensor<T>& specular, const Tensor<T>& grad_colour,
              Tensor<T>& grad_diffuse, Tensor<T>& grad_tint, Tensor<T>& grad_specular);

}  // namespace traceflow::shade
