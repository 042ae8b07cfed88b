#include "errors.h"

#include <exception>
#include <new>
#include <system_error>

#include "arrays.h"
#include "base/device_memory.h"
#include "parts.h"

namespace traceflow::python {

namespace {

// The classes live as long as the interpreter.
PyObject* input_error = nullptr;
PyObject* internal_error = nullptr;
PyObject* memory_error = nullptr;
PyObject* training_error = nullptr;

PyObject* make_error(py::module_& module, const char* name, const char* doc, const py::tuple& bases) {
  PyObject* made =
      PyErr_NewExceptionWithDoc((std::string("traceflow.") + name).c_str(), doc, bases.ptr(), nullptr);
  if (made == nullptr) throw py::error_already_set();
  module.attr(name) = py::reinterpret_borrow<py::object>(made);
  return made;
}

py::handle builtin(PyObject* type) { return {type}; }

}  // namespace

void add_errors(py::module_& module) {
  PyObject* base = make_error(module, "Error", "An error of TraceFlow, with the program's text.",
                              py::make_tuple(builtin(PyExc_Exception)));
  input_error = make_error(module, "InputError",
                           "A file, an option or an argument that cannot be used: its text names it, what "
                           "was found and what was expected.",
                           py::make_tuple(builtin(base), builtin(PyExc_ValueError)));
  internal_error =
      make_error(module, "InternalError", "A broken promise inside the program: a bug. Please report it.",
                 py::make_tuple(builtin(base), builtin(PyExc_RuntimeError)));
  memory_error = make_error(module, "OutOfMemoryError", "The device has too little memory.",
                            py::make_tuple(builtin(base), builtin(PyExc_MemoryError)));
  training_error =
      make_error(module, "TrainingError", "A training that could not go on. What it had reached is saved.",
                 py::make_tuple(builtin(base), builtin(PyExc_RuntimeError)));
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const InputError& e) {
      PyErr_SetString(input_error, e.what());
    } catch (const std::system_error& e) {  // a file, stream or thread that the system refuses
      PyErr_SetString(input_error, e.what());
    } catch (const TrainingEnded& e) {
      PyErr_SetString(training_error, e.what());
    } catch (const InternalError& e) {
      PyErr_SetString(internal_error, e.what());
    } catch (const std::bad_alloc& e) {
      const bool says_more = dynamic_cast<const memory::OutOfMemory*>(&e) != nullptr;
      PyErr_SetString(memory_error, says_more ? e.what() : "out of memory");
    }
  });
}

}  // namespace traceflow::python
