#pragma once

#include <memory>

#include "base/options.h"
#include "base/tensor.h"
#include "math/types.h"
#include "scene/surfels.h"

// Traces rays through surfels and blends all hits in the exact order of distance (method §5). Runs on the
// device of the rays, which must also be that of the surfels. Differentiable by all posed values except tint,
// and by ray origins, directions and widths.
namespace traceflow::trace {

struct Options {
  float t_min = 1e-3F;  // nearer hits are ignored; scene units, for any length of the direction
  float alpha_min = 1.0F / 255;
  float alpha_max = 0.99F;
  float transmittance_min = 1e-4F;
  // k: hits gathered between two checks of whether the ray has ended. Changes speed, never the image. On the
  // CUDA device k is fixed (cuda/traverse.h).
  int hits_per_pass = 64;
  Vec3<float> background{0};

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("t_min", t_min, "scene units", "Hits nearer than this are ignored (method §5.2).");
    v.field("alpha_min", alpha_min, "", "Hits with a lower opacity are skipped (method §3.3).");
    v.field("alpha_max", alpha_max, "", "Maximum opacity of a hit; higher values are clamped (method §3.3).");
    v.field("transmittance_min", transmittance_min, "",
            "A ray ends before its transmittance falls below this.");
    v.field(
        "hits_per_pass", hits_per_pass, "hits",
        "Number of hits collected before testing whether a ray has ended; affects the speed, not the image.");
  }
  void validate() const;
};

// R rays. A ray with a width represents a cone: directions with a Gaussian spread about its own, whose
// standard deviation is the width (a tangent). A surfel at distance t is convolved in its plane with an
// isotropic Gaussian of standard deviation width · t (method §5.5).
template <class T>
struct BasicRays {
  Tensor<T> origins;     // R×3, world
  Tensor<T> directions;  // R×3, world, of any length; SH is evaluated for the unit direction
  Tensor<T> widths{};    // R, ≥ 0; if empty, all are 0

  int64_t count() const { return origins.empty() ? 0 : origins.dim(0); }
  Device device() const { return origins.device(); }
  BasicRays on(Device device) const { return {origins.on(device), directions.on(device), widths.on(device)}; }
};
using Rays = BasicRays<float>;
template <class To, class From>
BasicRays<To> convert(const BasicRays<From>& rays) {
  return {convert<To>(rays.origins), convert<To>(rays.directions), convert<To>(rays.widths)};
}

template <class T>
struct BasicOutput {
  Tensor<T> colour;  // R×3, Σ w c + background · remaining transmittance; c depends on the ray's direction
  Tensor<T> alpha;   // R, Σ w
  Tensor<T> distance;  // R, Σ w t / Σ w in units of the direction's length; 0 if alpha is 0
};
using Output = BasicOutput<float>;

// dL/doutput. An empty tensor means zero.
template <class T>
struct BasicOutputGradient {
  Tensor<T> colour, alpha, distance;
};
using OutputGradient = BasicOutputGradient<float>;

template <class T>
struct BasicInputGradient {
  BasicPosedSurfels<T> surfels;
  BasicRays<T> rays;  // same shapes as the rays
  // The signal of density control: |Σ over hits of dL/dposition · t / 2| as in EnvGS, t in scene units.
  // Opposing gradients cancel, since such hits do not need more surfels. The reference leaves it empty.
  Tensor<T> position_gradient;
};
using InputGradient = BasicInputGradient<float>;

// A bounding volume hierarchy over the surfels' disks. A disk ends where α falls under alpha_min (method
// §5.1).
class Bvh;
struct BvhDeleter {
  void operator()(Bvh* bvh) const;
};
using BvhPtr = std::unique_ptr<Bvh, BvhDeleter>;
BvhPtr make_bvh();
// Builds or rebuilds; reuse one object across iterations. Leaves out surfels that are not finite, have no
// area, extend beyond 1e15 or have an opacity under alpha_min. The result does not depend on the number of
// threads.
void build(const PosedSurfels& surfels, const Options& options, Bvh& bvh);

// The lists of hits that forward() saves for backward(). Reuse one object across iterations.
struct Saved;
struct SavedDeleter {
  void operator()(Saved* saved) const;
};
using SavedPtr = std::unique_ptr<Saved, SavedDeleter>;
SavedPtr make_saved();
// The number of blended hits over all rays. Waits for the device.
int64_t blended_hits(const Saved& saved);
// Limits the memory on the CUDA device for the lists and for what backward() derives from them. The default
// is 1 GiB. If the hits of some rays do not fit, backward() traces those rays again, in parts.
void limit_device_bytes(Saved& saved, int64_t bytes);

// Rays that are not finite, have a zero direction or a negative width get the background. `bvh` must be built
// from these surfels. saved may be null.
void forward(const PosedSurfels& surfels, const Bvh& bvh, const Rays& rays, const Options& options,
             Output& output, Saved* saved);

// Sets `gradient`; does not add to it. On the CPU sums have a fixed order, so the result is bitwise the same
// for any number of threads. On the CUDA device this needs cuda::deterministic(). The BVH of the forward pass
// must not have been rebuilt.
void backward(const PosedSurfels& surfels, const Rays& rays, const Options& options, const Saved& saved,
              const OutputGradient& grad_output, InputGradient& gradient);

// Reference implementation: double precision, every ray against every surfel, sorted.
void forward_reference(const BasicPosedSurfels<double>& surfels, const BasicRays<double>& rays,
                       const Options& options, BasicOutput<double>& output);
void backward_reference(const BasicPosedSurfels<double>& surfels, const BasicRays<double>& rays,
                        const Options& options, const BasicOutputGradient<double>& grad_output,
                        BasicInputGradient<double>& gradient);

}  // namespace traceflow::trace
