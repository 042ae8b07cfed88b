#pragma once

#include "ops/field/field.h"
#include "scene/surfels.h"

// Stored surfels → surfels at time t (method §1.2, §1.3): residuals add to the stored values, then
// activations.
//   position p + Δp · rotation q + Δr (not normalised here) · scale exp(log s + Δs) · opacity σ(o + Δo) ·
//   tint σ(τ + Δτ), roughness σ(r) / 4
// Where there are bodies (scene/motion.h) the field moves what Surfels::body says; other residuals are zero.
// Differentiable: every stored value and the field's parameters. The position enters the field detached. Runs
// where the stored surfels are; the field is there too.
namespace traceflow::deform {

struct Saved {
  Tensor<float> points;     // m×3, where the field was evaluated
  Tensor<float> residuals;  // M×outputs; empty without a field
  Tensor<int32_t> moved;    // m, which of the M posed surfels the field moves (ascending); empty means all
  Tensor<float> of_moved;   // m×outputs, their residuals where these are not all
  field::Saved field;
};

// Poses the stored surfels whose indices `subset` lists (ascending; empty means all) at `time`. `field` null:
// F ≡ 0. sh_degree: how many degrees are copied out. saved may be null when no backward follows. A surfel
// that has a non-finite stored value or residual is posed with opacity 0, so that nothing downstream sees it.
void forward(const Surfels& stored, const Field* field, float time, const Tensor<int32_t>& subset,
             int sh_degree, field::Precision precision, PosedSurfels& posed, Saved* saved);

// The stored surfels with the residuals of `time` added and no activation: a scene of its own that stands
// still there, as an export at one time holds it. Not differentiable.
Surfels displaced(const Surfels& stored, const Field& field, float time, field::Precision precision);

// Adds to grad_stored (shapes of stored) and to grad_field (null when the forward pass had none or it is
// frozen). Reads the activated values back from `posed`, the forward pass's output. grad_residuals: what
// reaches Saved::residuals past `posed`, in their shape; empty: nothing.
void backward(const Surfels& stored, const Field* field, float time, const Tensor<int32_t>& subset,
              const PosedSurfels& posed, const Saved& saved, const PosedSurfels& grad_posed,
              const Tensor<float>& grad_residuals, Surfels& grad_stored, Field* grad_field);

// The plain truth in double precision, of all surfels. field_points: N×3, where the field is evaluated (the
// stored positions; separate because p enters detached, so that central differences can hold it still).
// grad_* may be null in the reverse.
void forward_reference(const BasicSurfels<double>& stored, const BasicField<double>* field,
                       const Tensor<double>& field_points, double time, int sh_degree,
                       BasicPosedSurfels<double>& posed);
void backward_reference(const BasicSurfels<double>& stored, const BasicField<double>* field,
                        const Tensor<double>& field_points, double time,
                        const BasicPosedSurfels<double>& grad_posed, BasicSurfels<double>& grad_stored,
                        BasicField<double>* grad_field);

}  // namespace traceflow::deform
