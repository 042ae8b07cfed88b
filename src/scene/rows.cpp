#include "scene/rows.h"

#include "base/parallel.h"

namespace traceflow {

namespace {

// The same shape with another number of rows.
Shape with_rows(const Shape& shape, int64_t rows) {
  switch (shape.rank()) {
    case 1:
      return {rows};
    case 2:
      return {rows, shape[1]};
    default:
      require(shape.rank() == 3, "surfel tensors have one to three dimensions", shape.to_string());
      return {rows, shape[1], shape[2]};
  }
}

}  // namespace

Tensor<float> edited_rows(const Tensor<float>& tensor, const RowEdit& edit, bool zero_fresh) {
  const int64_t row = tensor.row_size();
  Tensor<float> result(with_rows(tensor.shape(), edit.count()));
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

void append_rows(Surfels& surfels, const Surfels& more) {
  if (more.count() == 0) return;
  std::vector<const Tensor<float>*> added;
  more.for_each([&](const char*, const Tensor<float>& tensor) { added.push_back(&tensor); });
  size_t group = 0;
  surfels.for_each([&](const char* name, Tensor<float>& tensor) {
    require(group < added.size() && added[group]->row_size() == tensor.row_size(),
            "both sets have the same groups", name);
    const Tensor<float>& tail = *added[group++];
    Tensor<float> joined(with_rows(tensor.shape(), tensor.dim(0) + tail.dim(0)));
    std::copy(tensor.data(), tensor.data() + tensor.size(), joined.data());
    std::copy(tail.data(), tail.data() + tail.size(), joined.data() + tensor.size());
    tensor = std::move(joined);
  });
}

}  // namespace traceflow
