#pragma once

#include <memory>

#include "arrays.h"

// Properties of classes whose members are tensors.
namespace traceflow::python {

template <class Owner, class T>
void add_tensor(py::class_<Owner, std::shared_ptr<Owner>>& kind, const char* name, Tensor<T> Owner::*member,
                const char* doc) {
  kind.def_property(
      name, [member](const std::shared_ptr<Owner>& self) { return array_or_none(self, (*self).*member); },
      [member, name](Owner& self, const py::object& value) { assign(self.*member, value, name); }, doc);
}

// A property that nobody can change, as it holds indices of something else.
template <class Owner, class T>
void add_index_tensor(py::class_<Owner, std::shared_ptr<Owner>>& kind, const char* name,
                      Tensor<T> Owner::*member, const char* doc) {
  kind.def_property_readonly(
      name,
      [member](const std::shared_ptr<Owner>& self) {
        return array_or_none(self, (*self).*member, Access::read_only);
      },
      doc);
}

// Sets a tensor of an object under construction. None leaves it empty.
template <class T>
void take(Tensor<T>& tensor, const py::object& array, const char* name, const Dimensions& expected) {
  if (!array.is_none()) tensor = *tensor_of_array<T>(array, name, expected);
}

}  // namespace traceflow::python
