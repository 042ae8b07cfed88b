#pragma once

#include "ops/loss/loss_kernels.h"
#include "primitives/sums.h"

// The terms on normals, in single precision on any device and for the reference.
namespace traceflow::loss {

template <class T>
void mean_normal_consistency(const Tensor<T>& normal, const Tensor<T>& alpha, const Tensor<T>& pseudo,
                             double weight, Tensor<T>& grad_normal, Tensor<T>& grad_alpha,
                             Tensor<T>& grad_pseudo, Mean* mean) {
  check_is_image(normal);
  check_same_shape(normal, pseudo, grad_normal);
  check_same_shape(normal, pseudo, grad_pseudo);
  const int64_t pixels = normal.size() / 3;
  require(alpha.size() == pixels && grad_alpha.size() == pixels, "each pixel has an alpha",
          alpha.shape().to_string() + ", gradient " + grad_alpha.shape().to_string());
  const auto count = static_cast<double>(pixels);
  const NormalConsistency<T> step{
      normal.data(),      alpha.data(),      pseudo.data(),     static_cast<T>(weight / count),
      grad_normal.data(), grad_alpha.data(), grad_pseudo.data()};
  ordered_sum<double>(normal.device(), "loss: normal consistency", pixels, step, MeanOver{count, mean},
                      block_pixels);
}

template <class T>
void mean_normal_prior(const Tensor<T>& normal, const Tensor<T>& prior, const Tensor<T>& tint,
                       double on_mirrors, double weight, Tensor<T>& grad_normal, Mean* mean) {
  check_is_image(normal);
  check_same_shape(normal, prior, grad_normal);
  const int64_t pixels = normal.size() / 3;
  require(tint.empty() || tint.size() == pixels, "each pixel has a tint", tint.shape().to_string());
  const NormalPrior<T> forward{normal.data(), prior.data(), tint.empty() ? nullptr : tint.data(),
                               static_cast<T>(on_mirrors - 1)};
  ordered_sum<CountedSum>(normal.device(), "loss: normal prior", pixels, forward, MeanOverCounted{mean},
                          block_pixels);
  parallel_for(normal.device(), "loss: normal prior backward", pixels,
               NormalPriorBackward<T>{forward, weight, mean, grad_normal.data()}, block_pixels);
}

}  // namespace traceflow::loss
