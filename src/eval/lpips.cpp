#include "eval/lpips.h"

#include <dnnl.h>
#include <omp.h>

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "eval/lpips_scaling.h"

namespace traceflow::lpips {

namespace {

// Activations are H×W×channels, so that the three pixels under one row of a 3×3 kernel lie side by side and
// gathering a pixel's neighbourhood is three copies. A convolution is then one matrix product per block of
// pixels.
constexpr int64_t pixels_per_block = 128;

// Keeps the matrix library on the calling thread: blocks are what is dealt to threads, and a product that is
// not split has the same bytes at any thread count.
class OneThread {
 public:
  OneThread() : before_(omp_get_max_threads()) { omp_set_num_threads(1); }
  ~OneThread() { omp_set_num_threads(before_); }
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;

 private:
  int before_;
};

// (3·3·in)×out, rows in the order in which a neighbourhood is gathered.
Tensor<float> as_matrix(const Tensor<float>& weight) {
  const int64_t outputs = weight.dim(0), inputs = weight.dim(1);
  Tensor<float> matrix(Shape{9 * inputs, outputs});
  for (int64_t o = 0; o < outputs; ++o) {
    for (int64_t c = 0; c < inputs; ++c) {
      for (int64_t k = 0; k < 9; ++k) matrix(k * inputs + c, o) = weight[(o * inputs + c) * 9 + k];
    }
  }
  return matrix;
}

// The 3×3 neighbourhood of pixel (i, j), zero outside the image.
void gather(const Tensor<float>& x, int64_t i, int64_t j, float* out) {
  const int64_t h = x.dim(0), w = x.dim(1), channels = x.dim(2);
  const int64_t first = j == 0 ? 1 : 0;
  const int64_t last = j == w - 1 ? 1 : 2;
  for (int64_t di = -1; di <= 1; ++di, out += 3 * channels) {
    if (i + di < 0 || i + di >= h) {
      std::fill(out, out + 3 * channels, 0.0F);
      continue;
    }
    const float* row = x.data() + ((i + di) * w + j - 1) * channels;
    std::fill(out, out + first * channels, 0.0F);
    std::copy(row + first * channels, row + (last + 1) * channels, out + first * channels);
    std::fill(out + (last + 1) * channels, out + 3 * channels, 0.0F);
  }
}

Tensor<float> convolve_relu(const Tensor<float>& x, const Tensor<float>& matrix, const Tensor<float>& bias) {
  const int64_t h = x.dim(0), w = x.dim(1), k = matrix.dim(0), outputs = matrix.dim(1);
  Tensor<float> y;
  y.resize({h, w, outputs});
  parallel_blocks("lpips: convolve", h * w, pixels_per_block, [&](int64_t begin, int64_t end) {
    const OneThread one_thread;
    thread_local Tensor<float> patches;
    patches.resize({pixels_per_block, k});
    for (int64_t p = begin; p < end; ++p) {
      gather(x, p / w, p % w, patches.row(p - begin));
      std::copy(bias.data(), bias.data() + outputs, y.data() + p * outputs);
    }
    float* out = y.data() + begin * outputs;
    const dnnl_status_t status = dnnl_sgemm('N', 'N', end - begin, outputs, k, 1.0F, patches.data(), k,
                                            matrix.data(), outputs, 1.0F, out, outputs);
    require(status == dnnl_success, "the matrix product runs", std::to_string(static_cast<int>(status)));
    for (float* v = out; v < y.data() + end * outputs; ++v) *v = std::max(0.0F, *v);
  });
  return y;
}

Tensor<float> halve(const Tensor<float>& x) {
  const int64_t h = x.dim(0) / 2, w = x.dim(1) / 2, channels = x.dim(2);
  Tensor<float> y;
  y.resize({h, w, channels});
  parallel_for(
      "lpips: halve", h,
      [&](int64_t i) {
        for (int64_t j = 0; j < w; ++j) {
          const float* a = x.data() + (2 * i * x.dim(1) + 2 * j) * channels;
          const float* b = a + x.dim(1) * channels;
          float* out = y.data() + (i * w + j) * channels;
          for (int64_t c = 0; c < channels; ++c) {
            out[c] = std::max(std::max(a[c], a[c + channels]), std::max(b[c], b[c + channels]));
          }
        }
      },
      8);
  return y;
}

Tensor<float> scaled_input(const Tensor<float>& image, Input input) {
  Tensor<float> x(image.shape());
  for (int64_t i = 0; i < x.size(); ++i) x[i] = scale_channel(image[i], i % 3, input);
  return x;
}

double inverse_length(const float* features, int64_t channels) {
  double sum = 0;
  for (int64_t c = 0; c < channels; ++c) sum += static_cast<double>(features[c]) * features[c];
  return 1 / (std::sqrt(sum) + length_epsilon);
}

double stage_distance(const Tensor<float>& a, const Tensor<float>& b, const Tensor<float>& linear) {
  const int64_t pixels = a.dim(0) * a.dim(1), channels = a.dim(2);
  const double sum = ordered_sum<double>(
      "lpips: compare", pixels,
      [&](int64_t p) {
        const float* fa = a.data() + p * channels;
        const float* fb = b.data() + p * channels;
        const double la = inverse_length(fa, channels), lb = inverse_length(fb, channels);
        double at_pixel = 0;
        for (int64_t c = 0; c < channels; ++c) {
          const double difference = fa[c] * la - fb[c] * lb;
          at_pixel += linear[c] * difference * difference;
        }
        return at_pixel;
      },
      512);
  return sum / static_cast<double>(pixels);
}

}  // namespace

double distance(const Weights& weights, const Tensor<float>& image, const Tensor<float>& target,
                Input input) {
  require(image.shape() == target.shape() && image.shape().rank() == 3 && image.dim(2) == 3,
          "both images are H×W×3", image.shape().to_string() + " and " + target.shape().to_string());
  require(std::min(image.dim(0), image.dim(1)) >= min_side, "an image for LPIPS has 16 pixels a side",
          image.shape().to_string());
  Tensor<float> a = scaled_input(image, input), b = scaled_input(target, input);
  double total = 0;
  size_t next = 0;
  for (int stage = 0; stage < stages; ++stage) {
    if (stage > 0) {
      a = halve(a);
      b = halve(b);
    }
    for (int i = 0; i < convolutions_in_stage[stage]; ++i, ++next) {
      const Weights::Convolution& convolution = weights.convolutions[next];
      const Tensor<float> matrix = as_matrix(convolution.weight);
      a = convolve_relu(a, matrix, convolution.bias);
      b = convolve_relu(b, matrix, convolution.bias);
    }
    total += stage_distance(a, b, weights.linear[static_cast<size_t>(stage)]);
  }
  return total;
}

}  // namespace traceflow::lpips
