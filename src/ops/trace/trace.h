#pragma once

#include <memory>

#include "base/options.h"
#include "base/tensor.h"
#include "math/types.h"
#include "scene/surfels.h"

// Traces rays through surfels and blends all hits in exact order of distance (method §5). Runs where the rays
// are, which is where the surfels are. Differentiable: every posed value but tint, ray origins, directions
// and widths.
namespace traceflow::trace {

struct Options {
  float t_min = 1e-3F;  // hits nearer than this are ignored; scene units, whatever the direction's length
  float alpha_min = 1.0F / 255;
  float alpha_max = 0.99F;
  float transmittance_min = 1e-4F;
  // k: hits gathered between two looks at whether the ray has ended. Changes speed, never the image. On the
  // CUDA device k is fixed (cuda/walk.h).
  int hits_per_pass = 64;
  Vec3<float> background{0};

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("t_min", t_min, "scene units", "Hits nearer than this are ignored (method §5.2).");
    v.field("alpha_min", alpha_min, "", "Opacity under which a hit is skipped (method §3.3).");
    v.field("alpha_max", alpha_max, "", "Opacity at which a hit is clamped (method §3.3).");
    v.field("transmittance_min", transmittance_min, "",
            "A ray ends before its transmittance falls under this.");
    v.field("hits_per_pass", hits_per_pass, "hits",
            "Hits gathered before looking whether a ray has ended; changes speed, not the image.");
  }
  void validate() const;
};

// R rays. One with a width stands for a cone of them: the directions of its rays are spread about its own as
// a Gaussian of that standard deviation (a tangent), so that a surfel at distance t is convolved, in its own
// plane, with an isotropic Gaussian of standard deviation width · t (method §5.5).
template <class T>
struct BasicRays {
  Tensor<T> origins;     // R×3, world
  Tensor<T> directions;  // R×3, world, of any length; SH uses the unit one
  Tensor<T> widths{};    // R, ≥ 0; empty: all are 0

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
  Tensor<T> colour;    // R×3, Σ w c + background · remaining transmittance; c by the ray's direction
  Tensor<T> alpha;     // R, Σ w
  Tensor<T> distance;  // R, Σ w t / Σ w in units of the direction's length; 0 where alpha is 0
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
  BasicRays<T> rays;  // in their shapes
  // M, the density-control signal: |Σ over hits of dL/dposition · t / 2| as EnvGS has it, t in scene units.
  // Hits that pull a surfel to all sides do not ask for more of it. The reference leaves it empty.
  Tensor<T> position_gradient;
};
using InputGradient = BasicInputGradient<float>;

// A bounding volume hierarchy over the surfels' disks, each out to where its α falls under alpha_min (method
// §5.1).
class Bvh;
struct BvhDeleter {
  void operator()(Bvh* bvh) const;
};
using BvhPtr = std::unique_ptr<Bvh, BvhDeleter>;
BvhPtr make_bvh();
// (Re)builds; reuse one object across iterations. Surfels that are not finite, have no area, reach beyond
// 1e15 or whose opacity is under alpha_min are left out. The result does not depend on the number of threads.
void build(const PosedSurfels& surfels, const Options& options, Bvh& bvh);

// The hit lists that forward keeps for backward. Reuse one object across iterations.
struct Saved;
struct SavedDeleter {
  void operator()(Saved* saved) const;
};
using SavedPtr = std::unique_ptr<Saved, SavedDeleter>;
SavedPtr make_saved();
// How many hits were blended, over all rays. Waits for the device.
int64_t blended_hits(const Saved& saved);
// How much of the CUDA device's memory the lists, and what backward makes of them, may take; 1 GiB until it
// is set. Rays whose hits do not fit are traced again by backward, in parts.
void limit_device_bytes(Saved& saved, int64_t bytes);

// Rays that are not finite, have a zero direction or a negative width see the background. `bvh` was built
// from these surfels. saved may be null.
void forward(const PosedSurfels& surfels, const Bvh& bvh, const Rays& rays, const Options& options,
             Output& output, Saved* saved);

// Sets (does not add to) `gradient`. On the CPU sums are in a fixed order: the same bytes at any thread
// count. On the CUDA device they are where cuda::deterministic() is set. The BVH of the forward pass has not
// been built anew since.
void backward(const PosedSurfels& surfels, const Rays& rays, const Options& options, const Saved& saved,
              const OutputGradient& grad_output, InputGradient& gradient);

// The plain truth: double precision, every ray against every surfel, sorted.
void forward_reference(const BasicPosedSurfels<double>& surfels, const BasicRays<double>& rays,
                       const Options& options, BasicOutput<double>& output);
void backward_reference(const BasicPosedSurfels<double>& surfels, const BasicRays<double>& rays,
                        const Options& options, const BasicOutputGradient<double>& grad_output,
                        BasicInputGradient<double>& gradient);

}  // namespace traceflow::trace
