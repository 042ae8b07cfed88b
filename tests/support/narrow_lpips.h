#pragma once

#include <algorithm>
#include <cmath>
#include <string>

#include "files/safetensors.h"
#include "ops/lpips/lpips.h"
#include "support/gradients.h"

// A perceptual network small enough for tests, and its file.
namespace traceflow::testing {

// Random but with activations of a healthy size.
inline lpips::Weights narrow_lpips_weights(uint64_t seed) {
  constexpr int widths[lpips::stages] = {4, 6, 8, 5, 7};
  Random random(seed);
  lpips::Weights weights;
  int64_t inputs = 3;
  for (int stage = 0; stage < lpips::stages; ++stage) {
    for (int i = 0; i < lpips::convolutions_in_stage[stage]; ++i) {
      const double bound = std::sqrt(6.0 / (9.0 * static_cast<double>(inputs)));
      weights.convolutions.push_back(
          {random_tensor<float>({widths[stage], inputs, 3, 3}, random, -bound, bound),
           random_tensor<float>({widths[stage]}, random, -0.1, 0.1)});
      inputs = widths[stage];
    }
    weights.linear.push_back(random_tensor<float>({widths[stage]}, random, 0, 1));
  }
  return weights;
}

// The distance at once, and its gradient added.
inline double lpips_distance(const lpips::Network& network, const Tensor<float>& image,
                             const Tensor<float>& target, lpips::Input input, double weight,
                             Tensor<float>& grad_image) {
  return loss::value_of(image.device(), [&](const loss::MeanSlot& value) {
    lpips::distance(network, image, target, input, weight, grad_image, value);
  });
}

// As scripts/export_lpips.py writes them.
inline Safetensors lpips_file(const lpips::Weights& weights) {
  constexpr int places[] = {0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28};
  Safetensors file;
  for (size_t i = 0; i < weights.convolutions.size(); ++i) {
    const std::string name = "features." + std::to_string(places[i]);
    file.add(name + ".weight", weights.convolutions[i].weight);
    file.add(name + ".bias", weights.convolutions[i].bias);
  }
  for (size_t i = 0; i < weights.linear.size(); ++i) {
    Tensor<float> linear(Shape{1, weights.linear[i].size(), 1, 1});
    std::copy(weights.linear[i].data(), weights.linear[i].data() + weights.linear[i].size(), linear.data());
    file.add("lin" + std::to_string(i) + ".model.1.weight", linear);
  }
  return file;
}

}  // namespace traceflow::testing
