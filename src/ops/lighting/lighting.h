#pragma once

#include <memory>

#include "scene/lighting.h"
#include "scene/surfels.h"

// The colours of posed surfels in changing light (scene/lighting.h). A surfel at p with the colour c of its
// harmonics, before that is limited to 0, gets exp(g(p, t)) c. g is the logarithm of its body there, or that
// of the grid if it belongs to no body. Differentiable: position, harmonics and all logarithms; the gradient
// by p is that within the grid's cell. Runs on the device of the surfels, where the lighting must be too.
namespace traceflow::lighting {

// What forward keeps for backward. Reuse one object across iterations to keep its memory.
struct Saved;
struct SavedDeleter {
  void operator()(Saved* saved) const;
};
using SavedPtr = std::unique_ptr<Saved, SavedDeleter>;
SavedPtr make_saved();

// Lights `posed` in place. body, subset: as in motion::forward.
void forward(const Lighting& lighting, const Tensor<int32_t>& body, float time, const Tensor<int32_t>& subset,
             PosedSurfels& posed, Saved& saved);

// Turns dL/d(lit surfels) in place into dL/d(surfels before lighting), and adds dL/dlighting to grad_lighting
// (null if it is frozen). lit: forward's output. Sums in a fixed order: the same bytes at any thread count.
void backward(const Lighting& lighting, float time, const PosedSurfels& lit, Saved& saved,
              PosedSurfels& grad_posed, Lighting* grad_lighting);

// Lights stored surfels in place; they must be where they are at that time. Not differentiable.
void light(const Lighting& lighting, const Tensor<int32_t>& body, float time, Surfels& surfels);

// Weights of a term of the loss, a sum over points and times of the grid. The four numbers of a body count as
// four points without neighbours.
struct Stiffness {
  double size = 0;       // g²/2
  double haste = 0;      // (g' − g)²/2 with g' at the next time
  double roughness = 0;  // Σ (g' − g)²/2 with g' at the next point along each axis
};
// Adds the gradient of the term, and zeroes the gradient of points on the faces of the box.
void resist(const Lighting& lighting, const Stiffness& weights, Lighting& gradient);
// The term's value, in double precision.
double resist_reference(const BasicLighting<double>& lighting, const Stiffness& weights);

// The reference in double precision, for all surfels.
void forward_reference(const BasicLighting<double>& lighting, const Tensor<int32_t>& body, double time,
                       BasicPosedSurfels<double>& posed);

}  // namespace traceflow::lighting
