#pragma once

#include <cmath>
#include <cstdint>

#include "math/rotation.h"
#include "math/types.h"

namespace traceflow {

// Adds the signal of one surfel in one iteration to its statistics.
struct AccumulateSignal {
  const float* signal;
  const uint8_t* touched;
  float *sum, *seen;

  TRACEFLOW_HD void operator()(int64_t i) const {
    if (touched[i] == 0 || !std::isfinite(signal[i])) return;
    sum[i] += signal[i];
    seen[i] += 1;
  }
};

// Moves the children of split surfels, the last rows of a set, to points drawn from their parents' Gaussians,
// and shrinks them.
struct ScatterChild {
  // As in 2DGS.
  static constexpr float shrink = 1.6F;

  int64_t first;
  const float* drawn;  // two normal random numbers per child
  float *position, *log_scale;
  const float* rotation;

  TRACEFLOW_HD void operator()(int64_t child) const {
    const int64_t i = first + child;
    const Mat3<float> axes = rotation_from_quaternion(load4<float>(rotation + 4 * i));
    float* const scale = log_scale + 2 * i;
    add3(position + 3 * i, drawn[2 * child] * std::exp(scale[0]) * axes[0] +
                               drawn[2 * child + 1] * std::exp(scale[1]) * axes[1]);
    scale[0] -= std::log(shrink);
    scale[1] -= std::log(shrink);
  }
};

// Gives a surfel of opacity o and its clone the opacity 1 − √(1 − o) each. Where they overlap they cover what
// the surfel covered (Rota Bulò et al., Revising Densification in Gaussian Splatting, 2024).
struct ShareOpacity {
  const int64_t* rows;
  float faint;  // opacities are not lowered below this
  float* opacity_logit;

  TRACEFLOW_HD void operator()(int64_t k) const {
    float& logit = opacity_logit[rows[k]];
    // 1 − o = 1/(1 + eˣ); with r its root, the logit of 1 − r is log((1 − r)/r).
    const double root = 1 / std::sqrt(1 + std::exp(double{logit}));
    const auto shared = static_cast<float>(std::log((1 - root) / root));
    const float least = logit < faint ? logit : faint;
    logit = shared < least ? least : shared;
  }
};

// Shortens a surfel that is longer than `longest` and than `aspect` times its width to the larger of the two.
// All values are logarithms.
struct ShortenNeedle {
  float aspect, longest;
  float* log_scale;
  TRACEFLOW_HD void operator()(int64_t i) const {
    float* const scale = log_scale + 2 * i;
    const float by_width = (scale[1] < scale[0] ? scale[1] : scale[0]) + aspect;
    const float most = by_width < longest ? longest : by_width;
    if (most < scale[0]) scale[0] = most;
    if (most < scale[1]) scale[1] = most;
  }
};

struct LowerTo {
  float ceiling;
  float* value;
  TRACEFLOW_HD void operator()(int64_t i) const {
    if (ceiling < value[i]) value[i] = ceiling;
  }
};

}  // namespace traceflow
