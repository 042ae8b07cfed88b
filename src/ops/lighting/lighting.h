#pragma once

#include <memory>

#include "scene/lighting.h"
#include "scene/surfels.h"

// The colours of posed surfels in light that changes (scene/lighting.h): a surfel at p of colour c, which is
// what its harmonics give before it is limited to 0, gets exp(g(p, t)) c, with g the logarithm of its body
// there, or the grid's where no body carries it. Differentiable: position, harmonics and all logarithms; the
// gradient by p is that of the grid's cell. Runs where the surfels are; the lighting is there too.
namespace traceflow::lighting {

// What forward keeps for backward. Reuse one object across iterations: its memory is kept.
struct Saved;
struct SavedDeleter {
  void operator()(Saved* saved) const;
};
using SavedPtr = std::unique_ptr<Saved, SavedDeleter>;
SavedPtr make_saved();

// Lights `posed` in place. body, subset: as motion::forward.
void forward(const Lighting& lighting, const Tensor<int32_t>& body, float time, const Tensor<int32_t>& subset,
             PosedSurfels& posed, Saved& saved);

// Turns dL/d(lit surfels) in place into dL/d(surfels as they were), and adds dL/dlighting to grad_lighting
// (null where it is frozen). lit: what forward made. Sums in a fixed order: the same bytes at any thread
// count.
void backward(const Lighting& lighting, float time, const PosedSurfels& lit, Saved& saved,
              PosedSurfels& grad_posed, Lighting* grad_lighting);

// Lights stored surfels in place, which stand where they are at that time. Not differentiable.
void light(const Lighting& lighting, const Tensor<int32_t>& body, float time, Surfels& surfels);

// Weights of a term of the loss, a sum over points and times of the grid. A body's four numbers count as four
// points without neighbours.
struct Stiffness {
  double size = 0;       // g²/2
  double haste = 0;      // (g' − g)²/2 with the next time's g'
  double roughness = 0;  // Σ (g' − g)²/2 with the next points' g' along each axis
};
// Adds the gradient of the term, and leaves none by the points on the box's faces.
void resist(const Lighting& lighting, const Stiffness& weights, Lighting& gradient);
// The term itself, in double precision.
double resist_reference(const BasicLighting<double>& lighting, const Stiffness& weights);

// The plain truth in double precision, of all surfels.
void forward_reference(const BasicLighting<double>& lighting, const Tensor<int32_t>& body, double time,
                       BasicPosedSurfels<double>& posed);

}  // namespace traceflow::lighting
