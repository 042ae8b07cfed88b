#pragma once

#include <memory>

#include "math/types.h"
#include "scene/motion.h"
#include "scene/nodes.h"
#include "scene/surfels.h"

// Posed surfels of bodies that bend (scene/nodes.h), before motion::forward moves them with their bodies. A
// surfel's rotation becomes exp(Σ w_n ω_n) q. Its harmonics do not rotate with a bend: bends are small, and
// to rotate each surfel's harmonics by its own rotation would cost more than everything else here. Surfels of
// no body, or of a body without nodes, are unchanged. Differentiable: position and rotation, turns and shifts
// of the nodes. Runs on the device of the surfels, where the nodes must be too.
namespace traceflow::nodes {

// What forward keeps for backward. Reuse one object across iterations to keep its memory.
struct Saved;
struct SavedDeleter {
  void operator()(Saved* saved) const;
};
using SavedPtr = std::unique_ptr<Saved, SavedDeleter>;
SavedPtr make_saved();

// Bends `posed` in place. body, subset: as in motion::forward.
void forward(const Nodes& nodes, const Tensor<int32_t>& body, float time, const Tensor<int32_t>& subset,
             PosedSurfels& posed, Saved& saved);

// Turns dL/d(bent surfels) in place into dL/d(surfels before bending), and adds dL/dnodes to grad_nodes (null
// if they are frozen). Sums in a fixed order: the same bytes at any thread count.
void backward(const Nodes& nodes, const Tensor<int32_t>& body, float time, const Tensor<int32_t>& subset,
              Saved& saved, PosedSurfels& grad_posed, Nodes* grad_nodes);

// Bends stored surfels in place to their shape at a time. Not differentiable.
void bend(const Nodes& nodes, const Tensor<int32_t>& body, float time, Surfels& surfels);

// Stiffness of the nodes: weights of a term of the loss, a mean over nodes and times.
struct Stiffness {
  double strain = 0;  // Σ_m a_nm |R_n (c_m − c_n) + c_n + s_n − c_m − s_m|²/r_n² over the other nodes m of
                      // the body, a_nm ∝ exp(−|c_m − c_n|²/8r_n²) with Σ a_nm = 1 (Sumner et al. 2007, E_reg)
  double haste = 0;  // |dω_n/dt|² + |ds_n/dt|²/r_n², t in lengths of the video
  // d²/(1 + d²)/2 (Geman-McClure). d r_n is the distance from the anchor to c_n + s_n as moved by the body's
  // pose.
  double travel = 0;
};
// Adds the gradient of the term. motion: of the bodies, a constant.
void resist(const Nodes& nodes, const Motion& motion, const Stiffness& weights, Nodes& gradient);
// The term's value, in double precision.
double resist_reference(const BasicNodes<double>& nodes, const BasicMotion<double>& motion,
                        const Stiffness& weights);

// The position of a node, c_n + s_n, as moved by its body's pose, at the k-th of the nodes' times.
Vec3<double> place_of(const Nodes& nodes, const Motion& motion, int64_t n, int64_t k);

// Zeroes the gradient by the first time, at which bodies are at rest.
void hold_first(Nodes& gradient);

// The reference in double precision, for all surfels.
void forward_reference(const BasicNodes<double>& nodes, const Tensor<int32_t>& body, double time,
                       BasicPosedSurfels<double>& posed);

}  // namespace traceflow::nodes
