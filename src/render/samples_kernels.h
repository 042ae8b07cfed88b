#pragma once

#include <cstdint>

#include "math/types.h"

// One pixel and its n×n samples, which are pixels of an image n times as wide and as high.
namespace traceflow {

struct SamplesOf {
  int64_t width;  // of the image, in pixels
  int64_t per_side;

  template <class Each>
  TRACEFLOW_HD void each(int64_t pixel, const Each& each) const {
    const int64_t row = width * per_side;
    const int64_t first = pixel / width * per_side * row + pixel % width * per_side;
    for (int64_t y = 0; y < per_side; ++y) {
      for (int64_t x = 0; x < per_side; ++x) each(first + y * row + x);
    }
  }
  TRACEFLOW_HD float share() const { return 1.0F / static_cast<float>(per_side * per_side); }
};

struct AverageSamples {
  SamplesOf samples;
  int64_t channels;
  const float* from;
  float* to;

  TRACEFLOW_HD void operator()(int64_t pixel) const {
    for (int64_t c = 0; c < channels; ++c) {
      float sum = 0;
      samples.each(pixel, [&](int64_t s) { sum += from[s * channels + c]; });
      to[pixel * channels + c] = samples.share() * sum;
    }
  }
};

struct AverageSamplesBackward {
  SamplesOf samples;
  int64_t channels;
  const float* gradient;
  float* to;

  TRACEFLOW_HD void operator()(int64_t pixel) const {
    for (int64_t c = 0; c < channels; ++c) {
      const float share = samples.share() * gradient[pixel * channels + c];
      samples.each(pixel, [&](int64_t s) { to[s * channels + c] = share; });
    }
  }
};

// Mean depths, weighted.
struct AverageDepths {
  SamplesOf samples;
  const float *depth, *weight;
  float* to;

  TRACEFLOW_HD void operator()(int64_t pixel) const {
    float sum = 0, weights = 0;
    samples.each(pixel, [&](int64_t s) {
      sum += weight[s] * depth[s];
      weights += weight[s];
    });
    to[pixel] = weights > 0 ? sum / weights : 0.0F;
  }
};

// Sets the gradient of the depths and adds to that of the weights.
struct AverageDepthsBackward {
  SamplesOf samples;
  const float *depth, *weight, *averaged, *gradient;
  float *to_depth, *to_weight;

  TRACEFLOW_HD void operator()(int64_t pixel) const {
    float weights = 0;
    samples.each(pixel, [&](int64_t s) { weights += weight[s]; });
    const float g = weights > 0 ? gradient[pixel] / weights : 0.0F;
    samples.each(pixel, [&](int64_t s) {
      to_depth[s] = g * weight[s];
      to_weight[s] += g * (depth[s] - averaged[pixel]);
    });
  }
};

// The mean over the samples that have a median depth.
struct AverageMedianDepths {
  SamplesOf samples;
  const float* depth;
  float* to;

  TRACEFLOW_HD void operator()(int64_t pixel) const {
    float sum = 0, count = 0;
    samples.each(pixel, [&](int64_t s) {
      sum += depth[s];
      count += depth[s] > 0 ? 1.0F : 0.0F;
    });
    to[pixel] = count > 0 ? sum / count : 0.0F;
  }
};

struct AverageMedianDepthsBackward {
  SamplesOf samples;
  const float *depth, *gradient;
  float* to;

  TRACEFLOW_HD void operator()(int64_t pixel) const {
    float count = 0;
    samples.each(pixel, [&](int64_t s) { count += depth[s] > 0 ? 1.0F : 0.0F; });
    samples.each(pixel, [&](int64_t s) { to[s] = depth[s] > 0 ? gradient[pixel] / count : 0.0F; });
  }
};

}  // namespace traceflow
