#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

#include "ops/loss/mean.h"
#include "ops/lpips/lpips_scaling.h"

// The element-wise steps between the network's products on the CUDA device. An element is four channels of a
// pixel, which are read and written at once. Elements of an activation are counted in 32 bits.
namespace traceflow::lpips::device {

struct alignas(16) Four {
  float x = 0, y = 0, z = 0, w = 0;

  TRACEFLOW_HD Four& operator+=(const Four& other) {
    x += other.x;
    y += other.y;
    z += other.z;
    w += other.w;
    return *this;
  }
};

// Small numbers of four channels, e.g. flags.
struct alignas(4) FourBytes {
  uint8_t x, y, z, w;
};

// 0, or NaN if any of the three is not finite, so that a sum shows whether all values were.
TRACEFLOW_HD inline double zero_if_finite(float a, float b, float c) {
  return std::isfinite(a) && std::isfinite(b) && std::isfinite(c) ? 0
                                                                  : std::numeric_limits<double>::quiet_NaN();
}

// The size of one image, or of several below each other.
struct Extent {
  uint32_t height, width;  // of one image
  uint32_t fours;          // elements per pixel

  // Whether the pixel at (row + down, column + right) is in the same image.
  TRACEFLOW_HD bool holds(uint32_t row, uint32_t column, int down, int right) const {
    return row + static_cast<uint32_t>(down) < height && column + static_cast<uint32_t>(right) < width;
  }
};

// Scales both images for the first convolution. i: pixel, those of the target after those of the image.
// Returns 0, or NaN if the pixel is not finite, since a closed gate could hide an infinity.
struct ScaleImages {
  const float *image, *target;
  int64_t pixels;  // of one image
  Input input;
  Four* scaled;

  TRACEFLOW_HD double operator()(int64_t i) const {
    const float* const from = i < pixels ? image + 3 * i : target + 3 * (i - pixels);
    scaled[i] = {scale_channel(from[0], 0, input), scale_channel(from[1], 1, input),
                 scale_channel(from[2], 2, input), 0};
    return zero_if_finite(from[0], from[1], from[2]);
  }
};

// A convolution's matrix and, as one more row, its bias, with zeros for the added channels. i: (row, column).
struct PadWeights {
  const float *matrix, *bias;
  uint32_t inputs, outputs, padded_inputs, padded_outputs;
  float* padded;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const auto index = static_cast<uint32_t>(i);
    const uint32_t column = index % padded_outputs, row = index / padded_outputs;
    const uint32_t place = row / padded_inputs, channel = row % padded_inputs;
    float value = 0;
    if (column < outputs && place == 9) value = bias[column];
    if (column < outputs && place < 9 && channel < inputs) {
      value = matrix[int64_t{place * inputs + channel} * outputs + column];
    }
    padded[i] = value;
  }
};

// Gathers the 3×3 neighbourhoods of the pixels from `first` on, zero outside the image. i: (pixel, place,
// element).
struct GatherPatches {
  const Four* x;
  Extent extent;
  uint32_t first;
  Four* patches;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const auto index = static_cast<uint32_t>(i);
    const uint32_t four = index % extent.fours, cell = index / extent.fours;
    const uint32_t place = cell % 9, pixel = first + cell / 9;
    const int down = static_cast<int>(place / 3) - 1, right = static_cast<int>(place % 3) - 1;
    const uint32_t line = pixel / extent.width, column = pixel % extent.width;
    const int64_t neighbour = int64_t{pixel} + down * int64_t{extent.width} + right;
    patches[i] =
        extent.holds(line % extent.height, column, down, right) ? x[neighbour * extent.fours + four] : Four{};
  }
};

// Replaces a product's bias and ReLU where the library does not support them. i: element.
struct AddBiasAndRelu {
  Four* values;
  const Four* bias;
  uint32_t fours;

  TRACEFLOW_HD static float relu(float x) { return x > 0 ? x : 0; }
  TRACEFLOW_HD void operator()(int64_t i) const {
    Four sum = values[i];
    sum += bias[static_cast<uint32_t>(i) % fours];
    values[i] = {relu(sum.x), relu(sum.y), relu(sum.z), relu(sum.w)};
  }
};

// Records which outputs of a ReLU are above zero. i: element.
struct KeepGates {
  const Four* y;
  FourBytes* gates;

  TRACEFLOW_HD static uint8_t gate(float y) { return y > 0 ? 1 : 0; }
  TRACEFLOW_HD void operator()(int64_t i) const {
    const Four v = y[i];
    gates[i] = {gate(v.x), gate(v.y), gate(v.z), gate(v.w)};
  }
};

// The largest of each 2×2 pixels, and which of the four is the first with that value, in reading order. The
// place is marked closed if the value is not above zero, since the gate of its ReLU is closed. i: element of
// the halved images.
struct Halve {
  static constexpr uint8_t closed = 4;

  const Four* x;
  Extent extent;  // of x
  Four* halved;
  FourBytes* places;
  int64_t placed;  // elements with recorded places: those of the first image, or none

  struct Largest {
    float value;
    uint8_t place = 0;

    TRACEFLOW_HD void see(float other, uint8_t at) {
      if (!(other > value)) return;
      value = other;
      place = at;
    }
    TRACEFLOW_HD uint8_t open_place() const { return value > 0 ? place : closed; }
  };

  TRACEFLOW_HD void operator()(int64_t i) const {
    const auto index = static_cast<uint32_t>(i);
    const uint32_t width = extent.width / 2, height = extent.height / 2;
    const uint32_t four = index % extent.fours, pixel = index / extent.fours;
    const uint32_t column = pixel % width, line = pixel / width;
    const int64_t top = int64_t{line / height} * extent.height + 2 * (line % height);
    const Four* const from = x + (top * extent.width + 2 * column) * extent.fours + four;
    const Four first = from[0];
    Largest a{first.x}, b{first.y}, c{first.z}, d{first.w};
    for (uint8_t place = 1; place < 4; ++place) {
      const Four other = from[int64_t{place / 2 * extent.width + place % 2} * extent.fours];
      a.see(other.x, place);
      b.see(other.y, place);
      c.see(other.z, place);
      d.see(other.w, place);
    }
    halved[i] = {a.value, b.value, c.value, d.value};
    if (i < placed) places[i] = {a.open_place(), b.open_place(), c.open_place(), d.open_place()};
  }
};

// Adds dL/d(halved) to dL/dx at the recorded places. i: element of the halved image.
struct HalveBackward {
  const Four* grad_halved;
  const FourBytes* places;
  Extent extent;  // of x
  float* grad_x;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const auto index = static_cast<uint32_t>(i);
    const uint32_t four = index % extent.fours, pixel = index / extent.fours;
    const uint32_t column = pixel % (extent.width / 2), row = pixel / (extent.width / 2);
    float* const to = grad_x + (int64_t{2 * row} * extent.width + 2 * column) * 4 * extent.fours + 4 * four;
    const FourBytes place = places[i];
    const Four grad = grad_halved[i];
    add(grad.x, place.x, to);
    add(grad.y, place.y, to + 1);
    add(grad.z, place.z, to + 2);
    add(grad.w, place.w, to + 3);
  }
  TRACEFLOW_HD void add(float grad, uint8_t place, float* to) const {
    if (place != Halve::closed) to[int64_t{place / 2 * extent.width + place % 2} * 4 * extent.fours] += grad;
  }
};

// Adds to dL/dx the gradient from the neighbourhoods of the pixels in [begin, end). gates: of the ReLU that
// computed x; null if there is none. i: (pixel from `first` on, element).
struct AddPatches {
  const Four* grad_patches;
  int64_t begin, end;
  int64_t first;  // of the pixels that those neighbourhoods reach
  Extent extent;
  const FourBytes* gates;
  Four* grad_x;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const auto index = static_cast<uint32_t>(i);
    const uint32_t four = index % extent.fours;
    const auto pixel = static_cast<uint32_t>(first) + index / extent.fours;
    const uint32_t row = pixel / extent.width, column = pixel % extent.width;
    Four sum = grad_x[int64_t{pixel} * extent.fours + four];
    for (int place = 0; place < 9; ++place) {
      // The pixel that has this one at that place of its neighbourhood.
      const int down = 1 - place / 3, right = 1 - place % 3;
      const int64_t source = int64_t{pixel} + down * int64_t{extent.width} + right;
      if (!extent.holds(row, column, down, right) || source < begin || source >= end) continue;
      sum += grad_patches[((source - begin) * 9 + place) * extent.fours + four];
    }
    if (gates != nullptr) {
      const FourBytes open = gates[int64_t{pixel} * extent.fours + four];
      sum = {through(sum.x, open.x), through(sum.y, open.y), through(sum.z, open.z), through(sum.w, open.w)};
    }
    grad_x[int64_t{pixel} * extent.fours + four] = sum;
  }
  TRACEFLOW_HD static float through(float grad, uint8_t open) { return open != 0 ? grad : 0; }
};

// Reads the distance at a pixel for the sum.
struct Load {
  const double* values;
  TRACEFLOW_HD double operator()(int64_t i) const { return values[i]; }
};

// Writes a sum as the distance's first share, or adds it as a further one.
struct BeginDistance {
  loss::Mean* distance;
  TRACEFLOW_HD void operator()(double sum) const { *distance = {sum, 1}; }
};
struct AddToDistance {
  loss::Mean* distance;
  double share;
  TRACEFLOW_HD void operator()(double sum) const { distance->value += share * sum; }
};

// 0, or NaN if a pixel's gradient is not finite. i: pixel.
struct CheckGradient {
  const Four* grad;
  TRACEFLOW_HD double operator()(int64_t i) const { return zero_if_finite(grad[i].x, grad[i].y, grad[i].z); }
};

// Adds dL/d(first convolution's input) to dL/dimage, unless the distance or any gradient is not finite. i:
// pixel.
struct AddGradient {
  const Four* grad;
  const loss::Mean* distance;
  const double* check;  // the sum of CheckGradient
  Input input;
  float* grad_image;

  TRACEFLOW_HD void add(float value, int64_t c, float* to) const {
    to[c] += static_cast<float>(static_cast<double>(value) * scale_channel_slope(c, input));
  }
  TRACEFLOW_HD void operator()(int64_t i) const {
    if (!std::isfinite(distance->value + *check)) return;
    add(grad[i].x, 0, grad_image + 3 * i);
    add(grad[i].y, 1, grad_image + 3 * i);
    add(grad[i].z, 2, grad_image + 3 * i);
  }
};

}  // namespace traceflow::lpips::device
