#pragma once

#include "base/random.h"
#include "scene/field.h"

// The residual field that benchmarks evaluate, and its work.
namespace traceflow::bench {

// The heads start at zero; these have been trained.
inline Field trained_field(int width, int outputs = residual::main_outputs) {
  Random random(1);
  Field field = make_field({.width = width}, outputs, random);
  for (float& w : field.head_weight.values()) w = static_cast<float>(random.uniform(-0.1, 0.1));
  return field;
}

// Floating-point operations that one point needs: a multiplication and an addition for every weight of the
// point's encoding and of the hidden values in every layer, once forward and, but for layer 0's and the
// skip's encoding (no gradient by the input), twice backward. Padding, the time's part and ReLU do not count.
struct FieldOperations {
  double forward = 0, backward = 0;

  FieldOperations() = default;
  explicit FieldOperations(const Field& field) {
    const NetworkOptions& shape = field.shape;
    const double encoding = 3 + 6 * shape.position_frequencies;
    double by_weights = field.outputs() * shape.width, by_input = by_weights;
    for (int layer = 0; layer < shape.depth; ++layer) {
      const double hidden = layer == 0 ? 0 : shape.width;
      const double seen = layer == 0 || layer == shape.skip ? encoding : 0;
      by_weights += (hidden + seen) * shape.width;
      by_input += hidden * shape.width;
    }
    forward = 2 * by_weights;
    backward = 2 * (by_weights + by_input);
  }
};

}  // namespace traceflow::bench
