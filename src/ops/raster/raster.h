#pragma once

#include <array>
#include <memory>
#include <string_view>

#include "base/options.h"
#include "base/tensor.h"
#include "math/camera.h"
#include "scene/surfels.h"

// Rasterises surfels to images with exact ray–plane intersection and front-to-back blending (method §3). All
// outputs are differentiable by all posed values and by the camera's pose, except the choice of the median
// hit.
namespace traceflow::raster {

// The order in which a pixel blends: by depth of the surfels' centres, as in 2DGS, or by depth of the hits,
// exact per pixel.
enum class SortOrder { centre, hit };
constexpr std::array<std::string_view, 2> enum_names(SortOrder) { return {"centre", "hit"}; }

// Lower limit of transmittance_min: the backward pass divides by the remaining transmittance.
inline constexpr float least_transmittance = 1e-30F;

struct Options {
  SortOrder sort = SortOrder::centre;
  // Hits with a smaller camera z are dropped, and with sort = centre also surfels with a smaller camera z of
  // their centre. Scene units.
  float near_plane = 0.01F;
  float far_plane = 100;  // used only in the distortion's depth mapping
  float low_pass = 1;     // 0: none
  float alpha_min = 1.0F / 255;
  float alpha_max = 0.99F;
  float transmittance_min = 1e-4F;
  Vec3<float> background{0};

  void validate() const;
};

// All tensors are H×W (×3). w_i = α_i T_i (method §3.5).
template <class T>
struct BasicOutput {
  Tensor<T> colour;        // H×W×3, Σ w c + background · remaining transmittance
  Tensor<T> alpha;         // H×W, Σ w
  Tensor<T> tint;          // H×W, Σ w s_tint (α_spec); zero if the surfels have no tint
  Tensor<T> silhouette;    // H×W, Σ w s_body; empty if the surfels have no `in_body`
  Tensor<T> roughness;     // H×W, Σ w s_roughness; empty if the surfels have no roughness
  Tensor<T> normal;        // H×W×3, world axes, Σ w n with n facing the camera; not normalised
  Tensor<T> depth;         // H×W, expected camera z: Σ w z / Σ w; 0 where alpha is 0
  Tensor<T> median_depth;  // H×W, camera z of the hit where the transmittance crosses 0.5; 0 if none does
  Tensor<T> distortion;    // H×W, Σ w_i w_j (m_i − m_j)² over pairs i > j, each pair once as in 2DGS
};
using Output = BasicOutput<float>;

// dL/doutput. An empty tensor means zero.
template <class T>
struct BasicOutputGradient {
  Tensor<T> colour, alpha, tint, silhouette, roughness, normal, depth, median_depth, distortion;
};
using OutputGradient = BasicOutputGradient<float>;

template <class T>
struct BasicInputGradient {
  BasicPosedSurfels<T> surfels;
  CameraGradient<T> camera;
  bool wants_camera = true;  // false: the camera's gradient is left at zero
  // The signal of density control (method §3.7): norm of dL/d(projected centre) in normalised device
  // coordinates (pixels times half the image size, as in 2DGS), including the low-pass. The reference leaves
  // it empty.
  Tensor<T> screen_gradient;
};
using InputGradient = BasicInputGradient<float>;

// What forward() saves for backward(). Reuse one object across iterations to reuse its memory.
struct Saved;
struct SavedDeleter {
  void operator()(Saved* saved) const;
};
using SavedPtr = std::unique_ptr<Saved, SavedDeleter>;
SavedPtr make_saved();

// Rasterises. Resizes the output tensors. saved may be null if no backward pass follows. Skips surfels that
// are not finite, have no area or are behind the near plane.
void forward(const PosedSurfels& surfels, const Camera<float>& camera, const Options& options, Output& output,
             Saved* saved);

// Sets `gradient`; does not add to it. Sums have a fixed order, so the result is bitwise the same for any
// number of threads.
void backward(const PosedSurfels& surfels, const Camera<float>& camera, const Options& options,
              const Saved& saved, const OutputGradient& grad_output, InputGradient& gradient);

// Call after forward() with `saved`. Sets M flags (resized): 1 if at least one pixel blended the surfel.
void visible(const Saved& saved, Tensor<uint8_t>& flags);

// Call after forward() with `saved`. Counts pairs of a pixel and a surfel, as a measure of the work done.
struct Work {
  int64_t evaluated =
      0;  // the Gaussian was evaluated: all pairs in 4×4 blocks where at least one pixel blended the surfel
  int64_t listed = 0;  // the surfel is in the list of the pixel's 16×16 tile
};
Work work(const Saved& saved);

// Reference implementation: double precision, every pixel against every surfel, both sort orders, no cut-offs
// beyond those documented.
void forward_reference(const BasicPosedSurfels<double>& surfels, const Camera<double>& camera,
                       const Options& options, BasicOutput<double>& output);
void backward_reference(const BasicPosedSurfels<double>& surfels, const Camera<double>& camera,
                        const Options& options, const BasicOutputGradient<double>& grad_output,
                        BasicInputGradient<double>& gradient);

}  // namespace traceflow::raster
