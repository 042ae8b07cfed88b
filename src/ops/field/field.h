#pragma once

#include "base/tensor.h"
#include "scene/field.h"

// Evaluates a residual field's network F(x, t) at many points and one time: encoding, hidden layers with ReLU, linear heads
// (method §1.2). Every row is independent. Differentiable: the field's parameters. x and t enter detached.
namespace traceflow::field {

// Arithmetic of the hidden layers' matrix products. The encoding's part (layer 0 and the skip) is always fp32.
enum class Precision { fp32, bf16 };

// What forward keeps for backward. Reuse one object across iterations: its memory is kept.
struct Saved {
  Tensor<float> activations;  // implementation's own layout
  Precision precision = Precision::fp32;
};

// points: M×3, world. output: M × field.outputs(), resized. saved may be null when no backward follows. Points whose
// coordinates are not finite give zero rows.
void forward(const Field& field, const Tensor<float>& points, float time, Precision precision, Tensor<float>& output,
             Saved* saved);

// Adds dL/dparameters to grad_field (shapes of field) from grad_output (M × outputs). Sums in a fixed order: the same bytes
// at any thread count.
void backward(const Field& field, const Tensor<float>& points, float time, const Saved& saved,
              const Tensor<float>& grad_output, Field& grad_field);

// The plain truth in double precision.
void forward_reference(const BasicField<double>& field, const Tensor<double>& points, double time,
                       Tensor<double>& output);
void backward_reference(const BasicField<double>& field, const Tensor<double>& points, double time,
                        const Tensor<double>& grad_output, BasicField<double>& grad_field);

// Whether this machine has bf16 dot products, so that Precision::bf16 is worth choosing.
bool bf16_is_fast();

}  // namespace traceflow::field
