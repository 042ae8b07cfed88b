#pragma once

#include "base/options.h"
#include "base/tensor.h"
#include "math/camera.h"

// From depths and normals to the surface that reflects light (method §4). Every step runs on the device of
// its images.
namespace traceflow::surface {

// Pseudo-normals (method §4.1, §4.2): surface depth z = (1−ρ)·expected + ρ·median, points x = eye + z·ray,
// normal = normalised(∂x/∂v × ∂x/∂u) by central differences. The normal faces the camera. It is zero on the
// one-pixel border, where alpha is 0 at the pixel or at one of its four neighbours, and where the cross
// product vanishes or is not finite. depth, median_depth, alpha: H×W. normal: H×W×3, world axes, resized.
// Differentiable by both depths and by the camera's pose.
template <class T>
void pseudo_normals(const Camera<T>& camera, const Tensor<T>& depth, const Tensor<T>& median_depth,
                    const Tensor<T>& alpha, T depth_ratio, Tensor<T>& normal);
// Adds to grad_depth, grad_median_depth (H×W) and, unless it is null, grad_camera. A pixel whose gradient is
// not finite adds nothing.
template <class T>
void pseudo_normals_backward(const Camera<T>& camera, const Tensor<T>& depth, const Tensor<T>& median_depth,
                             const Tensor<T>& alpha, T depth_ratio, const Tensor<T>& grad_normal,
                             Tensor<T>& grad_depth, Tensor<T>& grad_median_depth,
                             CameraGradient<T>* grad_camera);

// The pixels to trace (method §4.4), ascending, and the weight of each pixel's gradient.
struct TracedPixels {
  Tensor<int32_t> pixel;  // row-major index
  Tensor<float> weight;   // 1, or 1/share for pixels drawn at random
};

struct SelectOptions {
  float min_alpha = 1.0F / 1024;
  float min_tint = 1.0F / 512;
  float probe_share = 0.1F;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("min_alpha", min_alpha, "", "Pixels with a lower alpha reflect nothing (method §4.4).");
    v.field("min_tint", min_tint, "", "Pixels with a lower specular tint are not traced (method §4.4).");
    v.field("probe_share", probe_share, "",
            "Share of the pixels below min_tint that training traces anyway, so that their tint can grow.");
  }
  void validate() const;
};

// Selects the pixels above both thresholds, and a random share of those that fail the tint alone, by a hash
// of (seed, pixel). probes: false when rendering, which selects no random pixels. Pixels whose normal is zero
// or not finite are never selected. The lists are on the device of alpha; their memory is reused.
void select_pixels(const Tensor<float>& alpha, const Tensor<float>& tint, const Tensor<float>& normal,
                   const SelectOptions& options, bool probes, uint64_t seed, TracedPixels& traced);
inline TracedPixels select_pixels(const Tensor<float>& alpha, const Tensor<float>& tint,
                                  const Tensor<float>& normal, const SelectOptions& options, bool probes,
                                  uint64_t seed) {
  TracedPixels traced;
  select_pixels(alpha, tint, normal, options, probes, seed, traced);
  return traced;
}

// Reflected rays (method §4.3) of the listed pixels: origin = surface point, direction = d − 2(d·n̂)n̂ of
// unit length, with n̂ the normalised blended normal. origins, directions: P×3, world, resized.
// Differentiable by both depths, the normal and the camera's pose. The direction is zero if the normal is
// zero or a value is not finite; every tracer returns its background for it.
template <class T>
void reflection_rays(const Camera<T>& camera, const Tensor<int32_t>& pixels, const Tensor<T>& depth,
                     const Tensor<T>& median_depth, const Tensor<T>& normal, T depth_ratio,
                     Tensor<T>& origins, Tensor<T>& directions);
// Adds to grad_depth, grad_median_depth, grad_normal and, unless it is null, grad_camera. A ray whose
// gradient is not finite adds nothing.
template <class T>
void reflection_rays_backward(const Camera<T>& camera, const Tensor<int32_t>& pixels, const Tensor<T>& depth,
                              const Tensor<T>& median_depth, const Tensor<T>& normal, T depth_ratio,
                              const Tensor<T>& grad_origins, const Tensor<T>& grad_directions,
                              Tensor<T>& grad_depth, Tensor<T>& grad_median_depth, Tensor<T>& grad_normal,
                              CameraGradient<T>* grad_camera);

}  // namespace traceflow::surface
