#include "scene/rows.h"

#include <algorithm>
#include <limits>

#include "base/parallel.h"
#include "scene/rows_kernels.h"

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

template <class T>
Tensor<T> take_rows(const Tensor<T>& tensor, const PlacedEdit& edit, bool zero_fresh) {
  const int64_t row = tensor.row_size();
  Tensor<T> result;
  result.place(tensor.device()).resize(with_rows(tensor.shape(), edit.count()));
  require(result.size() <= std::numeric_limits<uint32_t>::max(), "numbers of a set are counted in 32 bits",
          result.shape().to_string());
  parallel_for(tensor.device(), "scene: edit rows", result.size(),
               TakeRow<T>{edit.source.data(), zero_fresh ? edit.fresh.data() : nullptr,
                          static_cast<uint32_t>(row), tensor.data(), result.data()},
               16384);
  return result;
}

}  // namespace

Tensor<float> edited_rows(const Tensor<float>& tensor, const PlacedEdit& edit, bool zero_fresh) {
  return take_rows(tensor, edit, zero_fresh);
}

Surfels edited_rows(const Surfels& surfels, const PlacedEdit& edit) {
  Surfels result;
  for_each_field(
      [&](const SurfelField& field, const Tensor<float>& from, Tensor<float>& to) {
        if (!field.is_optional || !from.empty()) to = edited_rows(from, edit, false);
      },
      surfels, result);
  if (!surfels.body.empty()) result.body = take_rows(surfels.body, edit, false);
  return result;
}

void append_rows(Surfels& surfels, const Surfels& more) {
  if (more.count() == 0) return;
  require(surfels.body.empty() == more.body.empty(), "bodies carry both sets or neither", "");
  if (!more.body.empty()) {
    Tensor<int32_t> body({surfels.count() + more.count()});
    std::ranges::copy(surfels.body.values(), body.data());
    std::ranges::copy(more.body.values(), body.data() + surfels.count());
    surfels.body = std::move(body);
  }
  for_each_field(
      [](const SurfelField& field, Tensor<float>& tensor, const Tensor<float>& tail) {
        require(tail.empty() == tensor.empty() && (tail.empty() || tail.row_size() == tensor.row_size()),
                "both sets have the same fields", std::string(field.name));
        if (tensor.empty()) return;
        Tensor<float> joined(with_rows(tensor.shape(), tensor.dim(0) + tail.dim(0)));
        std::copy(tensor.data(), tensor.data() + tensor.size(), joined.data());
        std::copy(tail.data(), tail.data() + tail.size(), joined.data() + tensor.size());
        tensor = std::move(joined);
      },
      surfels, more);
}

}  // namespace traceflow
