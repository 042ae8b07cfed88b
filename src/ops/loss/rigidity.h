#pragma once

#include "ops/loss/mean.h"
#include "scene/neighbours.h"

// How far the motion of surfels is from rigid in the neighbourhood of each: a term of the loss that is not in
// the paper (off in its preset). One camera sees a moving object from one side at a time, so that growing
// looks like approaching. The distances between neighbours tell the two apart.
namespace traceflow::loss {

// Mean over the edges (i, j) of e²/(e² + strain²), e = (|x_i − x_j| − |p_i − p_j|)/r_i, with p at rest, x
// posed, and r_i the distance to the farthest of i's neighbours when `edges` was made. Edges stretched far
// beyond `strain` have almost no gradient, so that parts may separate. Edges with an end that is not posed, a
// rest length of zero or a value that is not finite are skipped. rest: N×3; posed: M×3, the surfels that
// `subset` lists (ascending; empty: all N). Writes the term's value to a slot and ADDS weight · dterm/dinput
// to the gradients, in the order of the edges. Runs on the device of the surfels. The mean of nothing is 0.
void rigidity(const Tensor<float>& rest, const Tensor<float>& posed, const Tensor<int32_t>& subset,
              const Neighbours& edges, double strain, double weight, Tensor<float>& grad_rest,
              Tensor<float>& grad_posed, const MeanSlot& value);
double rigidity_reference(const Tensor<double>& rest, const Tensor<double>& posed,
                          const Tensor<int32_t>& subset, const Neighbours& edges, double strain,
                          double weight, Tensor<double>& grad_rest, Tensor<double>& grad_posed);

}  // namespace traceflow::loss
