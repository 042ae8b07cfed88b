#include "arrays.h"

#include <fmt/format.h>

namespace traceflow::python {

namespace {

constexpr const char* capsule_name = "traceflow.SharedTensor";

}  // namespace

py::capsule capsule_of(SharedTensor shared) {
  auto held = std::make_unique<SharedTensor>(std::move(shared));
  py::capsule capsule(held.get(), capsule_name, [](PyObject* object) {
    delete static_cast<SharedTensor*>(PyCapsule_GetPointer(object, capsule_name));
  });
  held.release();  // the capsule deletes it
  return capsule;
}

const SharedTensor* shared_tensor_of(const py::array& array) {
  py::object base = array.base();
  while (base && py::isinstance<py::array>(base)) base = py::reinterpret_borrow<py::array>(base).base();
  if (!base || PyCapsule_IsValid(base.ptr(), capsule_name) == 0) return nullptr;
  return static_cast<const SharedTensor*>(PyCapsule_GetPointer(base.ptr(), capsule_name));
}

void refuse_array(const std::string& name, const py::object& found, const std::string& expected) {
  throw InputError("argument", name, py::cast<std::string>(py::repr(py::type::of(found))), expected);
}

void check_shape(const Shape& shape, const std::string& name, const Dimensions& expected) {
  bool fits = shape.rank() == static_cast<int>(expected.size());
  std::string words, found;
  for (int i = 0; i < shape.rank(); ++i) found += (i == 0 ? "" : "×") + fmt::format("{}", shape[i]);
  for (size_t i = 0; i < expected.size(); ++i) {
    const Dimension& dimension = expected[i];
    words += i == 0 ? "" : "×";
    words += dimension.letter != 0 ? std::string(1, dimension.letter) : fmt::format("{}", dimension.size);
    fits = fits && (dimension.letter != 0 || shape[static_cast<int>(i)] == dimension.size);
  }
  if (fits) return;
  throw InputError("argument", name, "shape " + (found.empty() ? "of one number" : found), "shape " + words);
}

}  // namespace traceflow::python
