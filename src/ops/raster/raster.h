#pragma once

#include <array>
#include <memory>
#include <string_view>

#include "base/options.h"
#include "base/tensor.h"
#include "math/camera.h"
#include "scene/surfels.h"

// Rasterises surfels into images: exact ray–plane intersection, front-to-back blending (method §3).
// Differentiable: every posed value and the camera pose; every output but which hit is the median.
namespace traceflow::raster {

// In which order a pixel blends: by depth of the surfels' centres, as 2DGS does, or by depth of the hits,
// exact per pixel.
enum class SortOrder { centre, hit };
constexpr std::array<std::string_view, 2> enum_names(SortOrder) { return {"centre", "hit"}; }

// The least that a ray may be cut at: the way back divides by what is left.
inline constexpr float least_transmittance = 1e-30F;

struct Options {
  SortOrder sort = SortOrder::centre;
  // Camera z under which a hit (and, for sort = centre, a whole surfel by its centre) is dropped; scene
  // units.
  float near_plane = 0.01F;
  float far_plane = 100;  // only for the distortion's depth mapping
  float low_pass = 1;     // 0: none
  float alpha_min = 1.0F / 255;
  float alpha_max = 0.99F;
  float transmittance_min = 1e-4F;
  Vec3<float> background{0};

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("sort", sort, "", "Blending order: centre (as 2DGS) or hit (exact per pixel) (method §3.3).");
    v.field("near_plane", near_plane, "scene units", "Nearest camera depth that is drawn (method §3.4).");
    v.field("far_plane", far_plane, "scene units",
            "Far end of the distortion's depth mapping (method §3.5).");
    v.field("low_pass", low_pass, "pixels", "Width of the screen-space low-pass (method §3.2); 0: none.");
    v.field("alpha_min", alpha_min, "", "Opacity under which a hit is skipped (method §3.3).");
    v.field("alpha_max", alpha_max, "", "Opacity at which a hit is clamped (method §3.3).");
    v.field("transmittance_min", transmittance_min, "",
            "A pixel ends before its transmittance falls under this.");
  }
  void validate() const;
};

// All H×W (×3). w_i = α_i T_i (method §3.5).
template <class T>
struct BasicOutput {
  Tensor<T> colour;        // H×W×3, Σ w c + background · remaining transmittance
  Tensor<T> alpha;         // H×W, Σ w
  Tensor<T> tint;          // H×W, Σ w s_tint (α_spec); zero when the surfels have no tint
  Tensor<T> silhouette;    // H×W, Σ w s_carried; empty when the surfels do not say what is carried
  Tensor<T> roughness;     // H×W, Σ w s_roughness; empty when the surfels have none
  Tensor<T> normal;        // H×W×3, world axes, Σ w n with n turned to the camera; not renormalised
  Tensor<T> depth;         // H×W, expected camera z: Σ w z / Σ w; 0 where alpha is 0
  Tensor<T> median_depth;  // H×W, camera z of the hit where the transmittance crosses 0.5; 0 where none does
  Tensor<T> distortion;  // H×W, Σ w_i w_j (m_i − m_j)² over pairs i > j, as 2DGS counts (each pair once)
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
  // M, the density-control signal (method §3.7): the norm of dL/d(projected centre) in normalised device
  // units (pixels times half the image size, as 2DGS), low-pass part included. The reference leaves it empty.
  Tensor<T> screen_gradient;
};
using InputGradient = BasicInputGradient<float>;

// What forward keeps for backward. Reuse one object across iterations: its memory is kept.
struct Saved;
struct SavedDeleter {
  void operator()(Saved* saved) const;
};
using SavedPtr = std::unique_ptr<Saved, SavedDeleter>;
SavedPtr make_saved();

// Draws. Output tensors are resized. saved may be null when no backward follows. Surfels that are not finite,
// have no area or lie behind the near plane are skipped.
void forward(const PosedSurfels& surfels, const Camera<float>& camera, const Options& options, Output& output,
             Saved* saved);

// Sets (does not add to) `gradient`. Sums in a fixed order: the same bytes at any thread count.
void backward(const PosedSurfels& surfels, const Camera<float>& camera, const Options& options,
              const Saved& saved, const OutputGradient& grad_output, InputGradient& gradient);

// After forward with `saved`: M flags (resized), 1 where the surfel touched at least one pixel's blend.
void visible(const Saved& saved, Tensor<uint8_t>& flags);

// After forward with `saved`: what its speed is measured in, as pairs of a pixel and a surfel.
struct Work {
  int64_t evaluated =
      0;  // the Gaussian was computed: in 4×4 blocks of which at least one pixel blended the surfel
  int64_t listed = 0;  // the surfel was in the list of the pixel's 16×16 tile
};
Work work(const Saved& saved);

// The plain truth: double precision, every pixel against every surfel, both sort orders, the cut-offs of the
// contract only.
void forward_reference(const BasicPosedSurfels<double>& surfels, const Camera<double>& camera,
                       const Options& options, BasicOutput<double>& output);
void backward_reference(const BasicPosedSurfels<double>& surfels, const Camera<double>& camera,
                        const Options& options, const BasicOutputGradient<double>& grad_output,
                        BasicInputGradient<double>& gradient);

}  // namespace traceflow::raster
