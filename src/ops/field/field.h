#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "base/tensor.h"
#include "scene/field.h"

// Evaluates a residual field's network F(x, t) at many points and one time: encoding, hidden layers with
// ReLU, linear heads (method §1.2). Every row is independent. Differentiable: the field's parameters. x and t
// enter detached. Runs where the field is; what it reads and writes is there too.
namespace traceflow::field {

// Arithmetic of the hidden layers' matrix products. The encoding's part (layer 0 and the skip) is always
// fp32, or on the CUDA device sums of bf16 products that come to within 2⁻¹⁶ of it. Where the machine is not
// fast at it (bf16_is_fast()), or the device has no such products, bf16 is computed as fp32.
enum class Precision { fp32, bf16 };
constexpr std::array<std::string_view, 2> enum_names(Precision) { return {"fp32", "bf16"}; }

// Whether this machine's CPU has bf16 dot products, so that Precision::bf16 is worth choosing on it.
bool bf16_is_fast();

// A point with a coordinate beyond this, in scene units, is not evaluated: its octaves say nothing in single
// precision.
inline constexpr float coordinate_limit = 1048576.0F;

// What forward keeps for backward. Reuse one object across iterations: its memory is kept.
struct Saved {
  // Bytes that activations may take; those of the last points that do not fit are computed again by backward,
  // a third more work for them. The result has the same bytes.
  int64_t memory_limit = int64_t{1} << 29;
  Tensor<std::byte> activations;  // per block of points and layer, implementation's own layout
  int64_t kept_blocks = 0;        // blocks of points whose activations are there
  Tensor<std::byte> weights;      // on the CUDA device: as its products read them
  Precision precision = Precision::fp32;
};

// points: M×3, world. output: M × field.outputs(), resized. saved may be null when no backward follows.
// Points whose coordinates are not finite, or beyond coordinate_limit, give zero rows.
void forward(const Field& field, const Tensor<float>& points, float time, Precision precision,
             Tensor<float>& output, Saved* saved);

// Adds dL/dparameters to grad_field (shapes of field) from grad_output (M × outputs). field, points and time
// are forward's. Sums in a fixed order: the same bytes at any thread count. A point that gave a zero row, or
// whose row of grad_output is not finite, adds nothing.
void backward(const Field& field, const Tensor<float>& points, float time, const Saved& saved,
              const Tensor<float>& grad_output, Field& grad_field);

// The plain truth in double precision.
void forward_reference(const BasicField<double>& field, const Tensor<double>& points, double time,
                       Tensor<double>& output);
void backward_reference(const BasicField<double>& field, const Tensor<double>& points, double time,
                        const Tensor<double>& grad_output, BasicField<double>& grad_field);

}  // namespace traceflow::field
