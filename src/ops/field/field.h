#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "base/tensor.h"
#include "scene/field.h"

// Evaluates a residual field's network F(x, t) at many points and one time: encoding, hidden layers with
// ReLU, linear heads (method §1.2). Every row is independent. Differentiable: the field's parameters. x and t
// enter detached. Runs on the device of the field, where all inputs must be.
namespace traceflow::field {

// Arithmetic of the hidden layers' matrix products. The encoding's part (layer 0 and the skip) is always
// fp32, or on the CUDA device sums of bf16 products that are within 2⁻¹⁶ of it. bf16 is computed as fp32 if
// it is slow on this machine (see bf16_is_fast()), or if the device has no such products.
enum class Precision { fp32, bf16 };
constexpr std::array<std::string_view, 2> enum_names(Precision) { return {"fp32", "bf16"}; }

// Whether this machine's CPU has bf16 dot products, so that Precision::bf16 is useful on it.
bool bf16_is_fast();

// Points with a coordinate beyond this, in scene units, are not evaluated: their octaves are meaningless in
// single precision.
inline constexpr float coordinate_limit = 1048576.0F;

// What forward keeps for backward. Reuse one object across iterations to keep its memory.
struct Saved {
  // Most bytes for activations. backward recomputes those of the last points that do not fit, which takes a
  // third more work for them. The result has the same bytes.
  int64_t memory_limit = int64_t{1} << 29;
  Tensor<std::byte> activations;  // per block of points and layer, in the implementation's layout
  int64_t kept_blocks = 0;        // blocks of points whose activations are kept
  Tensor<std::byte> weights;      // on the CUDA device: in the format of its products
  Precision precision = Precision::fp32;
};

// points: M×3, world. output: M × field.outputs(), resized. saved: may be null if no backward follows. Points
// with a coordinate that is not finite, or is beyond coordinate_limit, give zero rows.
void forward(const Field& field, const Tensor<float>& points, float time, Precision precision,
             Tensor<float>& output, Saved* saved);

// Adds dL/dparameters to grad_field (shapes of field), given grad_output (M × outputs). field, points and
// time are those of forward. Sums in a fixed order: the same bytes at any thread count. A point that gave a
// zero row, or whose row of grad_output is not finite, adds nothing.
void backward(const Field& field, const Tensor<float>& points, float time, const Saved& saved,
              const Tensor<float>& grad_output, Field& grad_field);

// The reference in double precision.
void forward_reference(const BasicField<double>& field, const Tensor<double>& points, double time,
                       Tensor<double>& output);
void backward_reference(const BasicField<double>& field, const Tensor<double>& points, double time,
                        const Tensor<double>& grad_output, BasicField<double>& grad_field);

}  // namespace traceflow::field
