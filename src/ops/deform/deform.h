#pragma once

#include "ops/field/field.h"
#include "scene/surfels.h"

// Stored surfels → surfels at time t (method §1.2, §1.3): residuals add to the stored values, then
// activations.
//   position p + Δp · rotation q + Δr (not normalised here) · scale exp(log s + Δs) · opacity σ(o + Δo) ·
//   tint σ(τ + Δτ), roughness σ(r) / 4
// With bodies (scene/motion.h) Surfels::body tells which surfels the field moves; the residuals of others are
// zero. Differentiable: every stored value and the field's parameters. The position enters the field
// detached. Runs on the device of the stored surfels, where the field must be too.
namespace traceflow::deform {

struct Saved {
  Tensor<float> points;     // m×3, where the field was evaluated
  Tensor<float> residuals;  // M×outputs; empty without a field
  Tensor<int32_t> moved;    // m, those of the M posed surfels that the field moves (ascending); empty: all
  Tensor<float> of_moved;   // m×outputs, their residuals, if these are not all
  field::Saved field;
};

// Poses the stored surfels listed in `subset` (ascending indices; empty: all) at `time`. field: null for F ≡
// 0. sh_degree: the highest degree that is copied. saved: may be null if no backward follows. A surfel with a
// stored value or residual that is not finite gets opacity 0, so that no later step sees it.
void forward(const Surfels& stored, const Field* field, float time, const Tensor<int32_t>& subset,
             int sh_degree, field::Precision precision, PosedSurfels& posed, Saved* saved);

// The stored surfels with the residuals of `time` added and no activation: a static scene, as an export at
// one time needs it. Not differentiable.
Surfels displaced(const Surfels& stored, const Field& field, float time, field::Precision precision);

// Adds to grad_stored (shapes of stored) and to grad_field (null if the forward pass had none or it is
// frozen). posed: the forward pass's output, from which the activated values are read. grad_residuals: an
// additional gradient of Saved::residuals, in their shape; empty: none.
void backward(const Surfels& stored, const Field* field, float time, const Tensor<int32_t>& subset,
              const PosedSurfels& posed, const Saved& saved, const PosedSurfels& grad_posed,
              const Tensor<float>& grad_residuals, Surfels& grad_stored, Field* grad_field);

// The reference in double precision, for all surfels. field_points: N×3, where the field is evaluated. They
// are the stored positions; they are separate because p enters detached, and central differences must keep
// them fixed. The gradients of backward_reference may be null.
void forward_reference(const BasicSurfels<double>& stored, const BasicField<double>* field,
                       const Tensor<double>& field_points, double time, int sh_degree,
                       BasicPosedSurfels<double>& posed);
void backward_reference(const BasicSurfels<double>& stored, const BasicField<double>* field,
                        const Tensor<double>& field_points, double time,
                        const BasicPosedSurfels<double>& grad_posed, BasicSurfels<double>& grad_stored,
                        BasicField<double>* grad_field);

}  // namespace traceflow::deform
