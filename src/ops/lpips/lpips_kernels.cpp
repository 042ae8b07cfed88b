#include "ops/lpips/lpips_kernels.h"

#include <dnnl.h>
#include <omp.h>

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "ops/lpips/lpips_directions.h"

namespace traceflow::lpips {

namespace {

// Channels vary fastest, so that the three pixels under one row of a 3×3 kernel are contiguous, and gathering
// a pixel's neighbourhood is three copies. A convolution is then one matrix product per block of pixels.
constexpr int64_t pixels_per_block = 128;
constexpr int64_t rows_per_block = 8;

// Keeps the matrix library on the calling thread. Threads share the blocks, and a product that is not split
// has the same bytes at any thread count.
class OneThread {
 public:
  OneThread() : before_(omp_get_max_threads()) { omp_set_num_threads(1); }
  ~OneThread() { omp_set_num_threads(before_); }
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;

 private:
  int before_;
};

// Copies the 3×3 neighbourhood of pixel (i, j), zero outside the image.
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

// Calls f(patches, begin, end) with the neighbourhoods of pixels [begin, end) of x, one per row.
template <class F>
void for_patches(const char* description, const Tensor<float>& x, F&& f) {
  const int64_t w = x.dim(1);
  parallel_blocks(description, x.dim(0) * w, pixels_per_block, [&](int64_t begin, int64_t end) {
    const OneThread one_thread;
    thread_local Tensor<float> patches;
    patches.resize({pixels_per_block, 9 * x.dim(2)});
    for (int64_t p = begin; p < end; ++p) gather(x, p / w, p % w, patches.row(p - begin));
    f(patches.data(), begin, end);
  });
}

void check(dnnl_status_t status) {
  require(status == dnnl_success, "the matrix product runs", std::to_string(static_cast<int>(status)));
}

double squares_of(const float* features, int64_t channels) {
  double sum = 0;
  for (int64_t c = 0; c < channels; ++c) sum += static_cast<double>(features[c]) * features[c];
  return sum;
}

// Both images' features at one pixel.
struct Pixel {
  const float* a;
  const float* b;
  const float* linear;
  int64_t channels;
  Directions directions{squares_of(a, channels), squares_of(b, channels)};

  double distance() const {
    double sum = 0;
    for (int64_t c = 0; c < channels; ++c) {
      const double difference = directions.difference(a[c], b[c]);
      sum += linear[c] * difference * difference;
    }
    return sum;
  }
  // grad = scale · ddistance/da.
  void gradient(double scale, float* grad) const {
    double along = 0;
    for (int64_t c = 0; c < channels; ++c) along += linear[c] * directions.difference(a[c], b[c]) * a[c];
    const Bend bend(directions, along, scale);
    for (int64_t c = 0; c < channels; ++c) {
      grad[c] = bend.gradient(linear[c], directions.difference(a[c], b[c]), a[c]);
    }
  }
};

// Calls f with the four values of each 2×2 pixels, in reading order, for each channel.
template <class T, class F>
Tensor<T> reduce_fours(const Tensor<float>& x, const F& f) {
  const int64_t h = x.dim(0) / 2, w = x.dim(1) / 2, channels = x.dim(2);
  Tensor<T> y;
  y.resize({h, w, channels});
  parallel_for(
      "lpips: halve", h,
      [&](int64_t i) {
        for (int64_t j = 0; j < w; ++j) {
          const float* a = x.data() + (2 * i * x.dim(1) + 2 * j) * channels;
          const float* b = a + x.dim(1) * channels;
          T* out = y.data() + (i * w + j) * channels;
          for (int64_t c = 0; c < channels; ++c) out[c] = f(a[c], a[c + channels], b[c], b[c + channels]);
        }
      },
      rows_per_block);
  return y;
}

}  // namespace

Tensor<float> convolve_relu(const Tensor<float>& x, const Network::Convolution& convolution) {
  const Tensor<float>& matrix = convolution.matrix;
  const int64_t k = matrix.dim(0), outputs = matrix.dim(1);
  Tensor<float> y;
  y.resize({x.dim(0), x.dim(1), outputs});
  for_patches("lpips: convolve", x, [&](const float* patches, int64_t begin, int64_t end) {
    float* out = y.data() + begin * outputs;
    float* out_end = y.data() + end * outputs;
    for (float* row = out; row < out_end; row += outputs) {
      std::copy(convolution.bias.data(), convolution.bias.data() + outputs, row);
    }
    check(dnnl_sgemm('N', 'N', end - begin, outputs, k, 1.0F, patches, k, matrix.data(), outputs, 1.0F, out,
                     outputs));
    // With this order of arguments a NaN stays NaN.
    for (float* v = out; v < out_end; ++v) *v = std::max(*v, 0.0F);
  });
  return y;
}

Tensor<uint8_t> gates_of(const Tensor<float>& y) {
  Tensor<uint8_t> gates;
  gates.resize(y.shape());
  parallel_for(
      "lpips: gates", y.size(), [&](int64_t i) { gates[i] = y[i] > 0 ? 1 : 0; }, 1 << 16);
  return gates;
}

Tensor<float> convolve_relu_backward(Tensor<float>& grad_y, const Tensor<uint8_t>& gates,
                                     const Network::Convolution& convolution) {
  const Tensor<float>& matrix = convolution.matrix;
  const int64_t outputs = matrix.dim(1), inputs = matrix.dim(0) / 9;
  parallel_for(
      "lpips: close gates", grad_y.size(),
      [&](int64_t i) {
        if (gates[i] == 0) grad_y[i] = 0;
      },
      1 << 16);
  Tensor<float> grad_x;
  grad_x.resize({grad_y.dim(0), grad_y.dim(1), inputs});
  // The neighbour at place k of a pixel has that pixel at its place 8 − k.
  for_patches("lpips: convolve backward", grad_y, [&](const float* patches, int64_t begin, int64_t end) {
    for (int64_t k = 0; k < 9; ++k) {
      check(dnnl_sgemm('N', 'T', end - begin, inputs, outputs, 1.0F, patches + k * outputs, 9 * outputs,
                       matrix.row((8 - k) * inputs), outputs, k == 0 ? 0.0F : 1.0F,
                       grad_x.data() + begin * inputs, inputs));
    }
  });
  return grad_x;
}

Tensor<float> halve(const Tensor<float>& x) {
  return reduce_fours<float>(
      x, [](float a, float b, float c, float d) { return std::max(std::max(a, b), std::max(c, d)); });
}

Tensor<uint8_t> largest_places(const Tensor<float>& x) {
  return reduce_fours<uint8_t>(x, [](float a, float b, float c, float d) {
    const float four[] = {a, b, c, d};
    return static_cast<uint8_t>(std::max_element(four, four + 4) - four);
  });
}

void halve_backward(const Tensor<float>& grad_halved, const Tensor<uint8_t>& places, Tensor<float>& grad_x) {
  const int64_t w = places.dim(1), channels = places.dim(2);
  parallel_for(
      "lpips: halve backward", places.dim(0),
      [&](int64_t i) {
        for (int64_t j = 0; j < w; ++j) {
          const float* grad = grad_halved.data() + (i * w + j) * channels;
          const uint8_t* place = places.data() + (i * w + j) * channels;
          for (int64_t c = 0; c < channels; ++c) {
            grad_x(2 * i + place[c] / 2, 2 * j + place[c] % 2, c) += grad[c];
          }
        }
      },
      rows_per_block);
}

double stage_distance(const Tensor<float>& a, const Tensor<float>& b, const Tensor<float>& linear,
                      double weight, Tensor<float>* grad_a) {
  const int64_t pixels = a.dim(0) * a.dim(1), channels = a.dim(2);
  const double share = 1 / static_cast<double>(pixels);
  if (grad_a != nullptr) grad_a->resize(a.shape());
  const double sum = ordered_sum<double>(
      "lpips: compare", pixels,
      [&](int64_t p) {
        const Pixel at_pixel{a.data() + p * channels, b.data() + p * channels, linear.data(), channels};
        if (grad_a != nullptr) at_pixel.gradient(weight * share, grad_a->data() + p * channels);
        return at_pixel.distance();
      },
      512);
  return sum * share;
}

}  // namespace traceflow::lpips
