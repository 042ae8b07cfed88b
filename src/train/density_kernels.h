#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

#include "math/camera.h"
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

// Shortens a surfel of no body along each axis on which it extends by more than `margin` past the last point
// that a camera sees, towards the cameras (method §7.7). A surfel ends three standard deviations from its
// centre.
struct ShortenUnseen {
  static constexpr float ends = 3;
  static constexpr int steps = 12;  // from the centre to an end
  // A point that no camera sees does no harm if its distance to the cameras is at least this share of that of
  // the centre.
  static constexpr float not_nearer = 0.9F;

  const Camera<float>* cameras;
  int64_t camera_count;
  const int32_t* body;  // null: no bodies
  const float *position, *rotation;
  float margin;
  float* log_scale;

  TRACEFLOW_HD float nearest2(const Vec3<float>& point) const {
    float nearest = std::numeric_limits<float>::max();
    for (int64_t c = 0; c < camera_count; ++c) {
      const Vec3<float> arm = point - cameras[c].position;
      if (dot(arm, arm) < nearest) nearest = dot(arm, arm);
    }
    return nearest;
  }
  TRACEFLOW_HD bool harmless(const Vec3<float>& point, float nearest2_of_centre) const {
    for (int64_t c = 0; c < camera_count; ++c)
      if (cameras[c].sees(point)) return true;
    return nearest2(point) >= not_nearer * not_nearer * nearest2_of_centre;
  }
  TRACEFLOW_HD void operator()(int64_t i) const {
    if (body != nullptr && body[i] >= 0) return;
    float* const scale = log_scale + 2 * i;
    const float longest = margin / ends;
    if (!(std::exp(scale[0]) > longest) && !(std::exp(scale[1]) > longest)) return;
    const Vec3<float> centre = load3<float>(position + 3 * i);
    const Mat3<float> axes = rotation_from_quaternion(load4<float>(rotation + 4 * i));
    const float of_centre = nearest2(centre);
    for (int axis = 0; axis < 2; ++axis) {
      const float end = ends * std::exp(scale[axis]);
      float limit = end;
      for (int side = -1; side <= 1; side += 2) {
        float last = 0;
        for (int k = 1; k <= steps; ++k) {
          const float x = end * static_cast<float>(k) / steps;
          if (harmless(centre + static_cast<float>(side) * x * axes[axis], of_centre)) last = x;
        }
        if (last + margin < limit) limit = last + margin;
      }
      if (limit < end) scale[axis] = std::log(limit / ends);
    }
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
