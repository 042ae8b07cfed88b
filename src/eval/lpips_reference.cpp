#include <algorithm>
#include <cmath>

#include "eval/lpips.h"
#include "eval/lpips_scaling.h"

namespace traceflow::lpips {

namespace {

// Activations are channels×H×W here, as the network is usually written down.
Tensor<double> scaled_input(const Tensor<double>& image, Input input) {
  const int64_t h = image.dim(0), w = image.dim(1);
  Tensor<double> x(Shape{3, h, w});
  for (int64_t i = 0; i < h * w; ++i) {
    for (int64_t c = 0; c < 3; ++c) x[c * h * w + i] = scale_channel(image[3 * i + c], c, input);
  }
  return x;
}

Tensor<double> convolve_relu(const Tensor<double>& x, const BasicWeights<double>::Convolution& convolution) {
  const int64_t inputs = x.dim(0), h = x.dim(1), w = x.dim(2), outputs = convolution.bias.size();
  Tensor<double> y(Shape{outputs, h, w});
  for (int64_t o = 0; o < outputs; ++o) {
    for (int64_t i = 0; i < h; ++i) {
      for (int64_t j = 0; j < w; ++j) {
        double sum = convolution.bias[o];
        for (int64_t c = 0; c < inputs; ++c) {
          for (int64_t di = -1; di <= 1; ++di) {
            for (int64_t dj = -1; dj <= 1; ++dj) {
              if (i + di < 0 || i + di >= h || j + dj < 0 || j + dj >= w) continue;
              sum += convolution.weight[((o * inputs + c) * 3 + di + 1) * 3 + dj + 1] * x(c, i + di, j + dj);
            }
          }
        }
        y(o, i, j) = std::max(0.0, sum);
      }
    }
  }
  return y;
}

Tensor<double> halve(const Tensor<double>& x) {
  Tensor<double> y(Shape{x.dim(0), x.dim(1) / 2, x.dim(2) / 2});
  for (int64_t c = 0; c < y.dim(0); ++c) {
    for (int64_t i = 0; i < y.dim(1); ++i) {
      for (int64_t j = 0; j < y.dim(2); ++j) {
        y(c, i, j) = std::max(
            {x(c, 2 * i, 2 * j), x(c, 2 * i, 2 * j + 1), x(c, 2 * i + 1, 2 * j), x(c, 2 * i + 1, 2 * j + 1)});
      }
    }
  }
  return y;
}

double length_at(const Tensor<double>& x, int64_t i, int64_t j) {
  double sum = 0;
  for (int64_t c = 0; c < x.dim(0); ++c) sum += x(c, i, j) * x(c, i, j);
  return std::sqrt(sum);
}

double stage_distance(const Tensor<double>& a, const Tensor<double>& b, const Tensor<double>& linear) {
  double sum = 0;
  for (int64_t i = 0; i < a.dim(1); ++i) {
    for (int64_t j = 0; j < a.dim(2); ++j) {
      const double length_a = length_at(a, i, j) + length_epsilon,
                   length_b = length_at(b, i, j) + length_epsilon;
      for (int64_t c = 0; c < a.dim(0); ++c) {
        const double difference = a(c, i, j) / length_a - b(c, i, j) / length_b;
        sum += linear[c] * difference * difference;
      }
    }
  }
  return sum / static_cast<double>(a.dim(1) * a.dim(2));
}

}  // namespace

double distance_reference(const BasicWeights<double>& weights, const Tensor<double>& image,
                          const Tensor<double>& target, Input input) {
  Tensor<double> a = scaled_input(image, input), b = scaled_input(target, input);
  double total = 0;
  size_t next = 0;
  for (int stage = 0; stage < stages; ++stage) {
    if (stage > 0) {
      a = halve(a);
      b = halve(b);
    }
    for (int i = 0; i < convolutions_in_stage[stage]; ++i, ++next) {
      a = convolve_relu(a, weights.convolutions[next]);
      b = convolve_relu(b, weights.convolutions[next]);
    }
    total += stage_distance(a, b, weights.linear[static_cast<size_t>(stage)]);
  }
  return total;
}

}  // namespace traceflow::lpips
