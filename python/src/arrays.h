#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <concepts>
#include <memory>
#include <string>
#include <type_traits>
#include <typeinfo>
#include <utility>
#include <vector>

#include "base/tensor.h"

// Tensors as NumPy arrays, and NumPy arrays as tensors.
namespace traceflow::python {

namespace py = pybind11;

// What the base of an array made by array_of() holds, so that an op finds the tensor again.
struct SharedTensor {
  std::shared_ptr<const void> owner;  // keeps the tensor alive
  const void* tensor;
  const std::type_info* type;  // of its elements
};

// The SharedTensor behind an array, or null.
const SharedTensor* shared_tensor_of(const py::array& array);
// A Python object that owns a SharedTensor.
py::capsule capsule_of(SharedTensor shared);
[[noreturn]] void refuse_array(const std::string& name, const py::object& found, const std::string& expected);

enum class Access { writable, read_only };

// The array that shares a tensor's memory and keeps its owner alive. The tensor must not be resized while
// its owner lives. A tensor on the CUDA device is copied to the host.
template <class T>
py::array array_of(std::shared_ptr<const void> owner, const Tensor<T>& tensor,
                   Access access = Access::writable) {
  if (tensor.device() != Device::cpu) {
    auto copy = std::make_shared<const Tensor<T>>(tensor.on(Device::cpu));
    return array_of(copy, *copy, access);
  }
  std::vector<py::ssize_t> shape(static_cast<size_t>(tensor.shape().rank()));
  for (size_t i = 0; i < shape.size(); ++i) shape[i] = tensor.dim(static_cast<int>(i));
  py::array array(py::dtype::of<T>(), shape, tensor.data(),
                  capsule_of({std::move(owner), &tensor, &typeid(T)}));
  if (access == Access::read_only) array.attr("setflags")(py::arg("write") = false);
  return array;
}

// The array takes the tensor's memory.
template <class T>
py::array array_of(Tensor<T>&& tensor) {
  auto held = std::make_shared<const Tensor<T>>(std::move(tensor));
  return array_of(held, *held);
}

// None for a tensor that is not there.
template <class T>
py::object array_or_none(std::shared_ptr<const void> owner, const Tensor<T>& tensor,
                         Access access = Access::writable) {
  if (tensor.shape().rank() == 0) return py::none();
  return array_of(std::move(owner), tensor, access);
}
template <class T>
py::object array_or_none(Tensor<T>&& tensor) {
  if (tensor.shape().rank() == 0) return py::none();
  return array_of(std::move(tensor));
}

// The size of one of an array's dimensions: a number, or a letter for any size, as in {'N', 3}.
struct Dimension {
  template <std::integral I>
  Dimension(I value)  // not explicit, so that lists of them read like shapes
      : size(static_cast<int64_t>(value)),
        letter(std::is_same_v<I, char> ? static_cast<char>(value) : '\0') {}
  int64_t size;
  char letter;
};
using Dimensions = std::vector<Dimension>;

// Throws InputError "argument NAME: found shape …, expected shape N×3".
void check_shape(const Shape& shape, const std::string& name, const Dimensions& expected);

// An array as a tensor: itself if the library made it and it is whole, else a copy as T. `name` is for
// messages. Throws InputError if it is no array of numbers or has another shape.
template <class T>
std::shared_ptr<const Tensor<T>> tensor_of_array(const py::object& object, const std::string& name,
                                                 const Dimensions& expected) {
  const auto array = py::array_t<T, py::array::c_style | py::array::forcecast>::ensure(object);
  if (!array || array.ndim() > 4) {
    PyErr_Clear();
    refuse_array(name, object, "an array of numbers");
  }
  std::vector<int64_t> sizes(array.shape(), array.shape() + array.ndim());
  const Shape shape{std::span<const int64_t>(sizes)};
  check_shape(shape, name, expected);
  if (const SharedTensor* shared = shared_tensor_of(array); shared != nullptr && *shared->type == typeid(T)) {
    const auto* tensor = static_cast<const Tensor<T>*>(shared->tensor);
    if (tensor->data() == array.data() && tensor->shape() == shape) return {shared->owner, tensor};
  }
  auto copy = std::make_shared<Tensor<T>>(shape);
  std::copy(array.data(), array.data() + array.size(), copy->data());
  return copy;
}

// An empty tensor for None.
template <class T>
std::shared_ptr<const Tensor<T>> tensor_or_none(const py::object& object, const std::string& name,
                                                const Dimensions& expected) {
  if (object.is_none()) return std::make_shared<const Tensor<T>>();
  return tensor_of_array<T>(object, name, expected);
}

// Writes an array into a tensor of the same shape, whose arrays see it.
template <class T>
void assign(Tensor<T>& tensor, const py::object& object, const std::string& name) {
  Dimensions expected;
  for (int i = 0; i < tensor.shape().rank(); ++i) expected.emplace_back(tensor.dim(i));
  if (tensor.shape().rank() == 0) refuse_array(name, object, "None: this set has no such field");
  const auto from = tensor_of_array<T>(object, name, expected);
  memory::copy(tensor.device(), tensor.data(), Device::cpu, from->data(),
               static_cast<size_t>(tensor.size()) * sizeof(T));
}

}  // namespace traceflow::python
