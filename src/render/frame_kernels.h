#pragma once

#include <cmath>
#include <cstdint>

#include "math/camera.h"

// The renderer's own element-wise steps, for either device.
namespace traceflow {

// The row in the stored set of posed row i. stored: null if all surfels are posed.
struct StoredRow {
  const int32_t* stored;
  TRACEFLOW_HD int64_t operator()(int64_t i) const { return stored == nullptr ? i : int64_t{stored[i]}; }
};

struct LargestSquare {
  float value = 0;
  TRACEFLOW_HD LargestSquare& operator+=(const LargestSquare& other) {
    if (other.value > value) value = other.value;
    return *this;
  }
};

// The squared distance between a surfel's stored and posed positions; 0 if that is not finite.
struct SquareOfMove {
  StoredRow row;
  const float *stored, *posed;

  TRACEFLOW_HD LargestSquare operator()(int64_t i) const {
    const Vec3<float> move = load3<float>(posed + 3 * i) - load3<float>(stored + 3 * row(i));
    const float length2 = dot(move, move);
    return {std::isfinite(length2) ? length2 : 0.0F};
  }
};
struct KeepRoot {
  float* kept;
  TRACEFLOW_HD void operator()(const LargestSquare& largest) const { *kept = std::sqrt(largest.value); }
};

struct AddNumbers {
  const float* from;
  float* to;
  TRACEFLOW_HD void operator()(int64_t i) const { to[i] += from[i]; }
};

// Adds what is behind the environment surfels: colour += (1 − α) · behind, per channel of a ray (method
// §5.4).
struct AddBehind {
  const float *alpha, *behind;
  float* colour;
  TRACEFLOW_HD void operator()(int64_t i) const { colour[i] += (1 - alpha[i / 3]) * behind[i]; }
};
struct AddBehindBackward {
  const float *alpha, *behind, *grad_colour;
  float *grad_alpha, *grad_behind;
  TRACEFLOW_HD void operator()(int64_t ray) const {
    float sum = 0;
    for (int64_t i = 3 * ray; i < 3 * ray + 3; ++i) {
      sum -= grad_colour[i] * behind[i];
      grad_behind[i] = (1 - alpha[ray]) * grad_colour[i];
    }
    grad_alpha[ray] = sum;
  }
};

// The width of a traced pixel's cone: the mean roughness of the surfels blended there (method §4.5).
struct ConeWidths {
  const int32_t* pixels;
  const float *roughness, *alpha;
  float* widths;
  TRACEFLOW_HD void operator()(int64_t i) const { widths[i] = roughness[pixels[i]] / alpha[pixels[i]]; }
};
// Adds to the gradient of roughness and, unless it is null, to that of alpha.
struct ConeWidthsBackward {
  const int32_t* pixels;
  const float *alpha, *widths, *grad_widths;
  float *grad_roughness, *grad_alpha;
  TRACEFLOW_HD void operator()(int64_t i) const {
    const float gradient = grad_widths[i] / alpha[pixels[i]];
    grad_roughness[pixels[i]] += gradient;
    if (grad_alpha != nullptr) grad_alpha[pixels[i]] -= gradient * widths[i];
  }
};

// Copies density control's signals of the drawn surfels to the rows of the stored ones.
struct PlaceSignal {
  StoredRow row;
  const float* posed_signal;
  const uint8_t* posed_drawn;
  float* signal;
  uint8_t* visible;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const int64_t k = row(i);
    signal[k] = posed_signal[i];
    visible[k] = posed_drawn[i];
  }
};

// 1 for a surfel of a body, else 0.
struct IsInBody {
  StoredRow row;
  const int32_t* body;
  float* to;
  TRACEFLOW_HD void operator()(int64_t i) const { to[i] = body[row(i)] >= 0 ? 1.0F : 0.0F; }
};

struct FlagNonZero {
  const float* value;
  uint8_t* flag;
  TRACEFLOW_HD void operator()(int64_t i) const { flag[i] = value[i] != 0 ? 1 : 0; }
};

// The bound grows at once and shrinks slowly.
struct FollowMaxDisplacement {
  const float* found;
  float* max_displacement;
  TRACEFLOW_HD void operator()(int64_t) const {
    const float before = 0.995F * *max_displacement;
    *max_displacement = *found > before ? *found : before;
  }
};

// The view frustum: inward unit normals of its four sides through the origin, in camera axes.
struct ViewPyramid {
  Vec3<float> left, right, top, bottom;

  explicit ViewPyramid(const Camera<float>& c) {
    const Vec3<float> low = c.ray_in_camera(0, 0);
    const Vec3<float> high = c.ray_in_camera(static_cast<float>(c.width), static_cast<float>(c.height));
    left = normalize(Vec3<float>(1, 0, -low.x));
    right = normalize(Vec3<float>(-1, 0, high.x));
    top = normalize(Vec3<float>(0, 1, -low.y));
    bottom = normalize(Vec3<float>(0, -1, high.y));
  }
  TRACEFLOW_HD bool meets(const Vec3<float>& centre, float radius, float near_plane) const {
    return centre.z + radius > near_plane && dot(left, centre) > -radius && dot(right, centre) > -radius &&
           dot(top, centre) > -radius && dot(bottom, centre) > -radius;
  }
};

// Returns whether a stored surfel may be visible (render/visibility.h).
struct CanShow {
  // A disk of opacity 1 ends at √(2 ln 255) = 3.33 standard deviations; the factor allows the field to make
  // it 1.5 times as wide. A disk smaller than a pixel ends at √(ln 255) = 2.36 widths of the low-pass (method
  // §3.2).
  static constexpr float disk_radius = 5.0F;
  static constexpr float low_pass_pixels = 2.36F;

  Camera<float> camera;
  ViewPyramid pyramid;
  const float *position, *log_scale;
  float near_plane;
  float low_pass;                 // width, pixels
  const float* max_displacement;  // null for 0
  const int32_t* body;            // null if there are no bodies

  TRACEFLOW_HD bool operator()(int64_t i) const {
    if (body != nullptr && body[i] >= 0) return true;
    const Vec3<float> centre = camera.point_in_camera(load3<float>(position + 3 * i));
    const float a = log_scale[2 * i], b = log_scale[2 * i + 1];
    const float moved = max_displacement != nullptr ? *max_displacement : 0.0F;
    const float disk = disk_radius * std::exp(a < b ? b : a);
    const float focal = camera.focal_x < camera.focal_y ? camera.focal_x : camera.focal_y;
    const float blurred = low_pass * low_pass_pixels * (centre.z + moved) / focal;
    const float radius = moved + (disk > blurred ? disk : blurred);
    return std::isfinite(radius) && pyramid.meets(centre, radius, near_plane);
  }
};

}  // namespace traceflow
