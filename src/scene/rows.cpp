#include "scene/rows.h"

#include "base/parallel.h"

namespace traceflow {

Tensor<float> edited_rows(const Tensor<float>& tensor, const RowEdit& edit, bool zero_fresh) {
  Shape shape = tensor.shape();
  const int64_t row = tensor.row_size();
  switch (shape.rank()) {
    case 1:
      shape = {edit.count()};
      break;
    case 2:
      shape = {edit.count(), shape[1]};
      break;
    case 3:
      shape = {edit.count(), shape[1], shape[2]};
      break;
    default:
      require(false, "surfel tensors have one to three dimensions", shape.to_string());
  }
  Tensor<float> result(shape);
  parallel_for("scene: edit rows", edit.count(), [&](int64_t i) {
    const auto k = static_cast<size_t>(i);
    if (zero_fresh && edit.fresh[k]) return;
    std::copy_n(tensor.data() + edit.source[k] * row, row, result.data() + i * row);
  });
  return result;
}

void edit_rows(Surfels& surfels, const RowEdit& edit) {
  surfels.for_each([&](const char*, Tensor<float>& tensor) { tensor = edited_rows(tensor, edit, false); });
}

}  // namespace traceflow
