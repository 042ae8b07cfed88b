#include <algorithm>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "math/types.h"
#include "ops/lpips/cuda/distance.h"
#include "ops/lpips/lpips_kernels.h"
#include "ops/lpips/lpips_scaling.h"

namespace traceflow::lpips {

namespace {

// What the backward pass needs of the forward pass. The weights are constants, so activations are not needed.
struct Trail {
  std::vector<Tensor<uint8_t>> gates;        // of each convolution
  std::vector<Tensor<uint8_t>> places;       // of the pooling after each stage except the last
  std::vector<Tensor<float>> grad_features;  // dL/d(a stage's last features) from its own share of the
                                             // distance
};

void check_images(const Network& network, const Tensor<float>& image, const Tensor<float>& target) {
  require(image.shape() == target.shape() && image.shape().rank() == 3 && image.dim(2) == 3,
          "both images are H×W×3", image.shape().to_string() + " and " + target.shape().to_string());
  require(std::min(image.dim(0), image.dim(1)) >= min_side, "an image for LPIPS has 16 pixels a side",
          image.shape().to_string());
  require(network.device() == image.device() && target.device() == image.device(),
          "the network and both images are on one device");
}

Tensor<float> scaled_input(const Tensor<float>& image, Input input) {
  Tensor<float> x;
  x.resize(image.shape());
  for (int64_t i = 0; i < x.size(); ++i) x[i] = scale_channel(image[i], i % 3, input);
  return x;
}

double forward(const Network& network, const Tensor<float>& image, const Tensor<float>& target, Input input,
               double weight, Trail* trail) {
  // A closed gate could hide an infinity.
  if (!all_finite(image.data(), image.size()) || !all_finite(target.data(), target.size()))
    return std::numeric_limits<double>::quiet_NaN();
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

double distance(const Network& network, const Tensor<float>& image, const Tensor<float>& target,
                Input input) {
  check_images(network, image, target);
  if (image.device() == Device::cpu) return forward(network, image, target, input, 0, nullptr);
  return loss::value_of(Device::cuda, [&](const loss::MeanSlot& value) {
    device::distance(network, image, target, input, value.on(Device::cuda));
  });
}

void distance(const Network& network, const Tensor<float>& image, const Tensor<float>& target, Input input,
              double weight, Tensor<float>& grad_image, const loss::MeanSlot& value) {
  check_images(network, image, target);
  require(grad_image.shape() == image.shape() && grad_image.device() == image.device(),
          "the gradient has the image's shape and device", grad_image.shape().to_string());
  loss::Mean* const mean = value.on(image.device());
  if (image.device() == Device::cuda) {
    device::distance(network, image, target, input, weight, grad_image, mean);
    return;
  }
  Trail trail;
  *mean = {forward(network, image, target, input, weight, &trail), 1};
  if (!std::isfinite(mean->value)) return;
  const Tensor<float> grad = backward(network, trail);
  if (!all_finite(grad.data(), grad.size())) return;
  for (int64_t i = 0; i < grad.size(); ++i) {
    grad_image[i] += static_cast<float>(grad[i] * scale_channel_slope(i % 3, input));
  }
}

}  // namespace traceflow::lpips
