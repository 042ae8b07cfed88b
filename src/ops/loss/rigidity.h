#pragma once

#include "ops/loss/mean.h"
#include "scene/neighbours.h"

// How far a set of surfels is from moving rigidly around each of them: a term of the loss that is not in the
// paper (off there). One camera sees a moving thing from one side at a time, so a thing that grows looks like
// a thing that comes closer; that neighbours keep their distances tells the two apart.
namespace traceflow::loss {

// Mean over the edges (i, j) of e²/(e² + strain²), e = (|x_i − x_j| − |p_i − p_j|)/r_i: p at rest, x posed,
// r_i the distance to the farthest of i's neighbours when `edges` was made. Edges stretched far beyond
// `strain` stop pulling, so that things may part. Edges with an end that is not posed, a rest length of zero
// or anything not finite are left out. rest: N×3; posed: M×3, the surfels that `subset` lists (ascending;
// empty means all N). Leaves the term's value in a slot and ADDS weight · dterm/dinput to the gradients, in
// the order of the edges. Runs where the surfels are. The mean of nothing is 0.
void rigidity(const Tensor<float>& rest, const Tensor<float>& posed, const Tensor<int32_t>& subset,
              const Neighbours& edges, double strain, double weight, Tensor<float>& grad_rest,
              Tensor<float>& grad_posed, const MeanSlot& value);
double rigidity_reference(const Tensor<double>& rest, const Tensor<double>& posed,
                          const Tensor<int32_t>& subset, const Neighbours& edges, double strain,
                          double weight, Tensor<double>& grad_rest, Tensor<double>& grad_posed);

}  // namespace traceflow::loss
