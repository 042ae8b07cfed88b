#pragma once

#include <optional>

#include "base/tensor.h"
#include "scene/field.h"

namespace traceflow {

// A trainable cube map looked up in the reflected direction (method §9), the alternative to environment
// surfels. The residual field moves the direction with time: d' = normalised(d + F(d, t)), where d enters F
// detached.
template <class T>
struct BasicEnvironmentMap {
  // (6·S)×S×3 logits, faces +x −x +y −y +z −z stacked, each S×S; colour = σ(logit), bilinear within a face.
  Tensor<T> logit;
  std::optional<BasicField<T>> field;  // 3 outputs

  int64_t face_size() const { return logit.empty() ? 0 : logit.dim(1); }

  // A copy on a device.
  BasicEnvironmentMap on(Device device) const {
    return {logit.on(device), field ? std::optional(field->on(device)) : std::nullopt};
  }
};
using EnvironmentMap = BasicEnvironmentMap<float>;

}  // namespace traceflow
