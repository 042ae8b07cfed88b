#pragma once

#include "ops/loss/loss.h"
#include "ops/loss/rigidity.h"

// The terms of the loss with their values at once, which the slots of training leave for later.
namespace traceflow::loss {

inline double l1(const Tensor<float>& image, const Tensor<float>& target, double weight,
                 Tensor<float>& grad_image) {
  return value_of(image.device(), [&](const MeanSlot& slot) { l1(image, target, weight, grad_image, slot); });
}
inline double ssim_loss(const Tensor<float>& image, const Tensor<float>& target, double weight,
                        Tensor<float>& grad_image) {
  return value_of(image.device(),
                  [&](const MeanSlot& slot) { ssim_loss(image, target, weight, grad_image, slot); });
}
inline double normal_consistency(const Tensor<float>& normal, const Tensor<float>& alpha,
                                 const Tensor<float>& pseudo, double weight, Tensor<float>& grad_normal,
                                 Tensor<float>& grad_alpha, Tensor<float>& grad_pseudo) {
  return value_of(normal.device(), [&](const MeanSlot& slot) {
    normal_consistency(normal, alpha, pseudo, weight, grad_normal, grad_alpha, grad_pseudo, slot);
  });
}
inline double normal_prior(const Tensor<float>& normal, const Tensor<float>& prior, double weight,
                           Tensor<float>& grad_normal, const Tensor<float>& tint = {},
                           double on_mirrors = 1) {
  return value_of(normal.device(), [&](const MeanSlot& slot) {
    normal_prior(normal, prior, tint, on_mirrors, weight, grad_normal, slot);
  });
}
inline double depth_prior(const Tensor<float>& depth, const Tensor<float>& prior, double weight,
                          Tensor<float>& grad_depth) {
  return value_of(depth.device(),
                  [&](const MeanSlot& slot) { depth_prior(depth, prior, weight, grad_depth, slot); });
}
inline double distortion(const Tensor<float>& map, double weight, Tensor<float>& grad_map) {
  return value_of(map.device(), [&](const MeanSlot& slot) { distortion(map, weight, grad_map, slot); });
}
inline double row_norm(const Tensor<float>& rows, double weight, Tensor<float>& grad_rows) {
  return value_of(rows.device(), [&](const MeanSlot& slot) { row_norm(rows, weight, grad_rows, slot); });
}
inline double squared_error(const Tensor<float>& image, const Tensor<float>& target,
                            const Tensor<uint8_t>& known = {}) {
  return value_of(image.device(), [&](const MeanSlot& slot) { squared_error(image, target, known, slot); });
}
inline double rigidity(const Tensor<float>& rest, const Tensor<float>& posed, const Tensor<int32_t>& subset,
                       const Neighbours& edges, double strain, double weight, Tensor<float>& grad_rest,
                       Tensor<float>& grad_posed) {
  return value_of(posed.device(), [&](const MeanSlot& slot) {
    rigidity(rest, posed, subset, edges, strain, weight, grad_rest, grad_posed, slot);
  });
}

}  // namespace traceflow::loss
