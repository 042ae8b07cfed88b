#include "scene/field.h"

#include <cmath>

namespace traceflow {

void NetworkOptions::validate() const {
  check_option(depth >= 1 && depth <= 32, "depth", depth, "1 to 32 layers");
  check_option(width >= 16 && width <= 1024 && width % 16 == 0, "width", width,
               "a multiple of 16 up to 1024");
  check_option(skip >= 0 && skip < depth, "skip", skip, "0 (none) or a layer below depth");
  check_option(position_frequencies >= 0 && position_frequencies <= 16, "position_frequencies",
               position_frequencies, "0 to 16");
  check_option(time_frequencies >= 0 && time_frequencies <= 16, "time_frequencies", time_frequencies,
               "0 to 16");
}

Field make_field(const NetworkOptions& shape, int outputs, Random& random) {
  shape.validate();
  Field field;
  field.shape = shape;
  for (int layer = 0; layer < shape.depth; ++layer) {
    const int inputs = shape.layer_inputs(layer);
    const double bound = 1.0 / std::sqrt(static_cast<double>(inputs));
    field.weight.emplace_back(Shape{shape.width, inputs});
    field.bias.emplace_back(Shape{shape.width});
    for (float& w : field.weight.back().values()) w = static_cast<float>(random.uniform(-bound, bound));
    for (float& b : field.bias.back().values()) b = static_cast<float>(random.uniform(-bound, bound));
  }
  field.head_weight = Tensor<float>(Shape{outputs, shape.width});
  field.head_bias = Tensor<float>(Shape{outputs});
  return field;
}

}  // namespace traceflow
