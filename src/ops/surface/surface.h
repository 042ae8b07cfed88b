#pragma once

#include "base/options.h"
#include "base/tensor.h"
#include "math/camera.h"

// From depth and normals to the surface that light is reflected at (method §4). Every step runs where its
// pictures are.
namespace traceflow::surface {

// Pseudo-normals (method §4.1, §4.2): surface depth z = (1−ρ)·expected + ρ·median, points x = eye + z·ray,
// normal = normalised(∂x/∂v × ∂x/∂u) by central differences, which faces the camera. Zero on the one-pixel
// border, where alpha is 0 at the pixel or one of its four neighbours, and where the cross product vanishes
// or is not finite. depth, median_depth, alpha: H×W. normal: H×W×3, world axes, resized. Differentiable: both
// depths, the camera pose.
template <class T>
void pseudo_normals(const Camera<T>& camera, const Tensor<T>& depth, const Tensor<T>& median_depth,
                    const Tensor<T>& alpha, T depth_ratio, Tensor<T>& normal);
// Adds to grad_depth, grad_median_depth (H×W) and, unless it is null, grad_camera. A pixel whose own gradient
// is not finite passes none on.
template <class T>
void pseudo_normals_backward(const Camera<T>& camera, const Tensor<T>& depth, const Tensor<T>& median_depth,
                             const Tensor<T>& alpha, T depth_ratio, const Tensor<T>& grad_normal,
                             Tensor<T>& grad_depth, Tensor<T>& grad_median_depth,
                             CameraGradient<T>* grad_camera);

// Which pixels are traced (method §4.4), ascending, and the weight of each one's gradient.
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
    v.field("min_alpha", min_alpha, "", "Alpha under which a pixel reflects nothing (method §4.4).");
    v.field("min_tint", min_tint, "", "Specular tint under which a pixel is not traced (method §4.4).");
    v.field("probe_share", probe_share, "",
            "Share of the other pixels that training traces, so that a tint can grow.");
  }
  void validate() const;
};

// Pixels that matter, and of the rest (with alpha above the threshold and a non-zero normal) a share drawn by
// a hash of (seed, pixel). probes false: rendering, no random pixels. A pixel whose normal is zero or not
// finite is never traced. The lists lie where alpha does; their memory is kept.
void select_pixels(const Tensor<float>& alpha, const Tensor<float>& tint, const Tensor<float>& normal,
                   const SelectOptions& options, bool probes, uint64_t seed, TracedPixels& traced);
inline TracedPixels select_pixels(const Tensor<float>& alpha, const Tensor<float>& tint,
                                  const Tensor<float>& normal, const SelectOptions& options, bool probes,
                                  uint64_t seed) {
  TracedPixels traced;
  select_pixels(alpha, tint, normal, options, probes, seed, traced);
  return traced;
}

// Mirrored rays (method §4.3) of the listed pixels: origin = surface point, direction = d − 2(d·n̂)n̂ of unit
// length, n̂ the blended normal normalised. origins, directions: P×3, world, resized. Differentiable: both
// depths, normal, camera pose. Where the normal is zero or something is not finite the direction is zero,
// which every tracer answers with its background.
template <class T>
void reflection_rays(const Camera<T>& camera, const Tensor<int32_t>& pixels, const Tensor<T>& depth,
                     const Tensor<T>& median_depth, const Tensor<T>& normal, T depth_ratio,
                     Tensor<T>& origins, Tensor<T>& directions);
// Adds to grad_depth, grad_median_depth, grad_normal and, unless it is null, grad_camera. A ray whose
// gradient is not finite passes none on.
template <class T>
void reflection_rays_backward(const Camera<T>& camera, const Tensor<int32_t>& pixels, const Tensor<T>& depth,
                              const Tensor<T>& median_depth, const Tensor<T>& normal, T depth_ratio,
                              const Tensor<T>& grad_origins, const Tensor<T>& grad_directions,
                              Tensor<T>& grad_depth, Tensor<T>& grad_median_depth, Tensor<T>& grad_normal,
                              CameraGradient<T>* grad_camera);

}  // namespace traceflow::surface
