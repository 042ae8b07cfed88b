#include <algorithm>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "ops/lpips/lpips_kernels.h"
#include "ops/lpips/lpips_scaling.h"

namespace traceflow::lpips {

namespace {

// What the way back needs of the way forward: the weights are constants, so no activations.
struct Trail {
  std::vector<Tensor<uint8_t>> gates;        // of each convolution
  std::vector<Tensor<uint8_t>> places;       // of the halving after each stage but the last
  std::vector<Tensor<float>> grad_features;  // dL/d(a stage's last features) by its own share of the distance
};

void check_images(const Tensor<float>& image, const Tensor<float>& target) {
  require(image.shape() == target.shape() && image.shape().rank() == 3 && image.dim(2) == 3,
          "both images are H×W×3", image.shape().to_string() + " and " + target.shape().to_string());
  require(std::min(image.dim(0), image.dim(1)) >= min_side, "an image for LPIPS has 16 pixels a side",
          image.shape().to_string());
}

bool all_finite(const Tensor<float>& x) {
  return std::all_of(x.data(), x.data() + x.size(), [](float v) { return std::isfinite(v); });
}

Tensor<float> scaled_input(const Tensor<float>& image, Input input) {
  Tensor<float> x;
  x.resize(image.shape());
  for (int64_t i = 0; i < x.size(); ++i) x[i] = scale_channel(image[i], i % 3, input);
  return x;
}

double forward(const Network& network, const Tensor<float>& image, const Tensor<float>& target, Input input,
               double weight, Trail* trail) {
  check_images(image, target);
  // An infinity could hide behind a gate.
  if (!all_finite(image) || !all_finite(target)) return std::numeric_limits<double>::quiet_NaN();
  Tensor<float> a = scaled_input(image, input), b = scaled_input(target, input);
  double total = 0;
  size_t next = 0;
  for (int stage = 0; stage < stages; ++stage) {
    if (stage > 0) {
      if (trail != nullptr) trail->places.push_back(largest_places(a));
      a = halve(a);
      b = halve(b);
    }
    for (int i = 0; i < convolutions_in_stage[stage]; ++i, ++next) {
      a = convolve_relu(a, network.convolutions[next]);
      b = convolve_relu(b, network.convolutions[next]);
      if (trail != nullptr) trail->gates.push_back(gates_of(a));
    }
    Tensor<float>* grad = trail == nullptr ? nullptr : &trail->grad_features.emplace_back();
    total += stage_distance(a, b, network.linear[static_cast<size_t>(stage)], weight, grad);
  }
  return total;
}

// dL/d(the first layer's input).
Tensor<float> backward(const Network& network, Trail& trail) {
  Tensor<float> grad;
  size_t next = network.convolutions.size();
  for (int stage = stages - 1; stage >= 0; --stage) {
    Tensor<float>& own = trail.grad_features.back();
    if (stage < stages - 1) halve_backward(grad, trail.places[static_cast<size_t>(stage)], own);
    grad = std::move(own);
    trail.grad_features.pop_back();
    for (int i = 0; i < convolutions_in_stage[stage]; ++i) {
      --next;
      grad = convolve_relu_backward(grad, trail.gates[next], network.convolutions[next]);
    }
  }
  return grad;
}

}  // namespace

Network network_of(const Weights& weights) {
  Network network;
  for (const Weights::Convolution& convolution : weights.convolutions) {
    const int64_t outputs = convolution.weight.dim(0), inputs = convolution.weight.dim(1);
    Tensor<float> matrix;
    matrix.resize({9 * inputs, outputs});
    for (int64_t o = 0; o < outputs; ++o) {
      for (int64_t c = 0; c < inputs; ++c) {
        for (int64_t k = 0; k < 9; ++k) {
          matrix(k * inputs + c, o) = convolution.weight[(o * inputs + c) * 9 + k];
        }
      }
    }
    network.convolutions.push_back({std::move(matrix), convolution.bias});
  }
  network.linear = weights.linear;
  return network;
}

double distance(const Network& network, const Tensor<float>& image, const Tensor<float>& target,
                Input input) {
  return forward(network, image, target, input, 0, nullptr);
}

double distance(const Network& network, const Tensor<float>& image, const Tensor<float>& target, Input input,
                double weight, Tensor<float>& grad_image) {
  require(grad_image.shape() == image.shape(), "the gradient has the image's shape",
          grad_image.shape().to_string());
  Trail trail;
  const double value = forward(network, image, target, input, weight, &trail);
  if (!std::isfinite(value)) return value;
  const Tensor<float> grad = backward(network, trail);
  if (!all_finite(grad)) return value;
  for (int64_t i = 0; i < grad.size(); ++i) {
    grad_image[i] += static_cast<float>(grad[i] * scale_channel_slope(i % 3, input));
  }
  return value;
}

}  // namespace traceflow::lpips
