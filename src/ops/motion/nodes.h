#pragma once

#include <memory>

#include "math/types.h"
#include "scene/motion.h"
#include "scene/nodes.h"
#include "scene/surfels.h"

// Posed surfels of bodies that bend (scene/nodes.h), before motion::forward moves them with their bodies. A
// surfel's rotation becomes exp(Σ w_n ω_n) q. Its colour does not turn with a bend: bends are small, and
// turning each surfel's harmonics by its own rotation costs more than everything else here. Surfels of no
// body, or of one without nodes, stay as they are. Differentiable: position and rotation, turns and shifts of
// the nodes. Runs where the surfels are; the nodes are there too.
namespace traceflow::nodes {

// What forward keeps for backward. Reuse one object across iterations: its memory is kept.
struct Saved;
struct SavedDeleter {
  void operator()(Saved* saved) const;
};
using SavedPtr = std::unique_ptr<Saved, SavedDeleter>;
SavedPtr make_saved();

// Bends `posed` in place. body, subset: as motion::forward.
void forward(const Nodes& nodes, const Tensor<int32_t>& body, float time, const Tensor<int32_t>& subset,
             PosedSurfels& posed, Saved& saved);

// Turns dL/d(bent surfels) in place into dL/d(surfels as they were), and adds dL/dnodes to grad_nodes (null
// where they are frozen). Sums in a fixed order: the same bytes at any thread count.
void backward(const Nodes& nodes, const Tensor<int32_t>& body, float time, const Tensor<int32_t>& subset,
              Saved& saved, PosedSurfels& grad_posed, Nodes* grad_nodes);

// Bends stored surfels in place to how they are at a time. Not differentiable.
void bend(const Nodes& nodes, const Tensor<int32_t>& body, float time, Surfels& surfels);

// How nodes resist: weights of a term of the loss, a mean over nodes and times.
struct Stiffness {
  double strain = 0;  // Σ_m a_nm |R_n (c_m − c_n) + c_n + s_n − c_m − s_m|²/r_n² over others of the body,
                      // a_nm ∝ exp(−|c_m − c_n|²/8r_n²) with Σ a_nm = 1 (Sumner et al. 2007, E_reg)
  double haste = 0;  // |dω_n/dt|² + |ds_n/dt|²/r_n², t in lengths of the film
  // d²/(1 + d²)/2 (Geman-McClure), d r_n being how far the body's pose has taken c_n + s_n from the anchor.
  double travel = 0;
};
// Adds the gradient of the term. motion: of the bodies, held.
void resist(const Nodes& nodes, const Motion& motion, const Stiffness& weights, Nodes& gradient);
// The term itself, in double precision.
double resist_reference(const BasicNodes<double>& nodes, const BasicMotion<double>& motion,
                        const Stiffness& weights);

// Where the bodies' poses take a node, c_n + s_n, at the k-th of the nodes' times.
Vec3<double> place_of(const Nodes& nodes, const Motion& motion, int64_t n, int64_t k);

// Zeroes the gradient by the first time: there bodies are at rest.
void hold_first(Nodes& gradient);

// The plain truth in double precision, of all surfels.
void forward_reference(const BasicNodes<double>& nodes, const Tensor<int32_t>& body, double time,
                       BasicPosedSurfels<double>& posed);

}  // namespace traceflow::nodes
