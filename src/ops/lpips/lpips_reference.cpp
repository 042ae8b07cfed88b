#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "ops/lpips/lpips.h"
#include "ops/lpips/lpips_directions.h"
#include "ops/lpips/lpips_scaling.h"

namespace traceflow::lpips {

namespace {

// Activations are channels×H×W here, the usual notation.
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

// dL/dx from dL/dy, with y = convolve_relu of x.
Tensor<double> convolve_relu_backward(const Tensor<double>& grad_y, const Tensor<double>& y,
                                      const BasicWeights<double>::Convolution& convolution) {
  const int64_t inputs = convolution.weight.dim(1), h = y.dim(1), w = y.dim(2), outputs = y.dim(0);
  Tensor<double> grad_x(Shape{inputs, h, w});
  for (int64_t o = 0; o < outputs; ++o) {
    for (int64_t i = 0; i < h; ++i) {
      for (int64_t j = 0; j < w; ++j) {
        if (!(y(o, i, j) > 0)) continue;
        for (int64_t c = 0; c < inputs; ++c) {
          for (int64_t di = -1; di <= 1; ++di) {
            for (int64_t dj = -1; dj <= 1; ++dj) {
              if (i + di < 0 || i + di >= h || j + dj < 0 || j + dj >= w) continue;
              grad_x(c, i + di, j + dj) +=
                  convolution.weight[((o * inputs + c) * 3 + di + 1) * 3 + dj + 1] * grad_y(o, i, j);
            }
          }
        }
      }
    }
  }
  return grad_x;
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

// Adds dL/d(halved) to dL/dx, at the first of the four pixels that is the largest.
void halve_backward(const Tensor<double>& grad_halved, const Tensor<double>& x, Tensor<double>& grad_x) {
  for (int64_t c = 0; c < grad_halved.dim(0); ++c) {
    for (int64_t i = 0; i < grad_halved.dim(1); ++i) {
      for (int64_t j = 0; j < grad_halved.dim(2); ++j) {
        int64_t row = 2 * i, column = 2 * j;
        for (const auto& [m, n] : {std::pair{2 * i, 2 * j + 1}, {2 * i + 1, 2 * j}, {2 * i + 1, 2 * j + 1}}) {
          if (x(c, m, n) > x(c, row, column)) {
            row = m;
            column = n;
          }
        }
        grad_x(c, row, column) += grad_halved(c, i, j);
      }
    }
  }
}

double length_at(const Tensor<double>& x, int64_t i, int64_t j) {
  double sum = 0;
  for (int64_t c = 0; c < x.dim(0); ++c) sum += x(c, i, j) * x(c, i, j);
  return std::sqrt(sum);
}

// Adds weight · dshare/da to grad_a.
double stage_distance(const Tensor<double>& a, const Tensor<double>& b, const Tensor<double>& linear,
                      double weight, Tensor<double>& grad_a) {
  const double pixels = static_cast<double>(a.dim(1) * a.dim(2));
  double sum = 0;
  for (int64_t i = 0; i < a.dim(1); ++i) {
    for (int64_t j = 0; j < a.dim(2); ++j) {
      const double length = length_at(a, i, j);
      const double length_a = length + length_epsilon, length_b = length_at(b, i, j) + length_epsilon;
      double along = 0;  // the gradient by the direction a/length_a, times a
      for (int64_t c = 0; c < a.dim(0); ++c) {
        const double difference = a(c, i, j) / length_a - b(c, i, j) / length_b;
        sum += linear[c] * difference * difference;
        along += 2 * linear[c] * difference * a(c, i, j);
      }
      if (length == 0) continue;
      for (int64_t c = 0; c < a.dim(0); ++c) {
        const double difference = a(c, i, j) / length_a - b(c, i, j) / length_b;
        grad_a(c, i, j) +=
            weight / pixels *
            (2 * linear[c] * difference / length_a - a(c, i, j) * along / (length * length_a * length_a));
      }
    }
  }
  return sum / pixels;
}

}  // namespace

double distance_reference(const BasicWeights<double>& weights, const Tensor<double>& image,
                          const Tensor<double>& target, Input input) {
  Tensor<double> unused(image.shape());
  return distance_reference(weights, image, target, input, 0, unused);
}

double distance_reference(const BasicWeights<double>& weights, const Tensor<double>& image,
                          const Tensor<double>& target, Input input, double weight,
                          Tensor<double>& grad_image) {
  // features[n]: the image's, after n convolutions.
  std::vector<Tensor<double>> features{scaled_input(image, input)}, grad_features(1);
  Tensor<double> b = scaled_input(target, input);
  double total = 0;
  size_t next = 0;
  for (int stage = 0; stage < stages; ++stage) {
    if (stage > 0) b = halve(b);
    for (int i = 0; i < convolutions_in_stage[stage]; ++i, ++next) {
      const Tensor<double> a = stage > 0 && i == 0 ? halve(features.back()) : features.back();
      features.push_back(convolve_relu(a, weights.convolutions[next]));
      grad_features.emplace_back(features.back().shape());
      b = convolve_relu(b, weights.convolutions[next]);
    }
    total += stage_distance(features.back(), b, weights.linear[static_cast<size_t>(stage)], weight,
                            grad_features.back());
  }
  if (weight == 0) return total;
  for (int stage = stages - 1; stage >= 0; --stage) {
    for (int i = convolutions_in_stage[stage] - 1; i >= 0; --i, --next) {
      Tensor<double> grad =
          convolve_relu_backward(grad_features[next], features[next], weights.convolutions[next - 1]);
      if (i == 0 && stage > 0) {
        halve_backward(grad, features[next - 1], grad_features[next - 1]);
      } else {
        grad_features[next - 1] = std::move(grad);
      }
    }
  }
  const Tensor<double>& grad = grad_features[0];
  for (int64_t i = 0; i < image.size(); ++i) {
    grad_image[i] += scale_channel_slope(i % 3, input) * grad[i % 3 * (image.size() / 3) + i / 3];
  }
  return total;
}

}  // namespace traceflow::lpips
