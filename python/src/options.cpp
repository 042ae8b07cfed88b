#include "options.h"

#include <fmt/format.h>

#include "capture/formats/capture_options.h"
#include "capture/synth/synth.h"
#include "files/options_json.h"
#include "parts.h"
#include "render/render_options.h"
#include "train/options.h"

namespace traceflow::python {

namespace {

constexpr const char* option_word = "option";

[[noreturn]] void refuse_value(const OptionField& field, const py::handle& value) {
  throw InputError(option_word, field.path, py::cast<std::string>(py::repr(value)), field.expected());
}

OptionValue value_of(const OptionField& field, const py::handle& value) {
  if (PyBool_Check(value.ptr())) return py::cast<bool>(value);
  if (PyIndex_Check(value.ptr()) != 0) {
    int overflow = 0;
    const auto number = py::reinterpret_steal<py::object>(PyNumber_Index(value.ptr()));
    if (!number) throw py::error_already_set();
    const long long read = PyLong_AsLongLongAndOverflow(number.ptr(), &overflow);
    if (overflow != 0) refuse_value(field, value);
    return int64_t{read};
  }
  if (PyFloat_Check(value.ptr()) || py::hasattr(value, "__float__"))
    return py::float_(py::reinterpret_borrow<py::object>(value)).operator double();
  if (PySequence_Check(value.ptr()) != 0) {
    std::vector<double> numbers;
    for (const auto& item : value) {
      if (!PyNumber_Check(item.ptr())) refuse_value(field, value);
      numbers.push_back(py::float_(py::reinterpret_borrow<py::object>(item)));
    }
    return numbers;
  }
  refuse_value(field, value);
}

template <class Options>
py::object get_option(Options& options, const std::string& path) {
  return to_python(find_option(option_fields(options), path, option_word, listed_by<Options>).get());
}

template <class Options>
py::list paths_of(Options& options) {
  py::list paths;
  for (const OptionField& field : option_fields(options)) paths.append(field.path);
  return paths;
}

template <class Options>
py::dict described(Options& options, const std::string& path) {
  const std::vector<OptionField> fields = option_fields(options);
  const OptionField& field = find_option(fields, path, option_word, listed_by<Options>);
  py::dict result;
  result["name"] = field.path;
  result["value"] = to_python(field.get());
  result["unit"] = field.unit;
  result["help"] = field.full_help();
  result["accepts"] = field.expected();
  return result;
}

template <class Options>
std::string table_of(Options& options, const char* name) {
  std::string text = fmt::format("{}:\n", name);
  for (const OptionField& field : option_fields(options)) {
    text += fmt::format("  {} = {}{}{}\n", field.path, option_text(field.get()),
                        field.unit.empty() ? "" : " ", field.unit);
  }
  return text;
}

template <class Options>
py::class_<Options> add_kind(py::module_& module, const char* name, const char* doc) {
  py::class_<Options> kind(module, name, doc);
  kind.def("__getitem__", &get_option<Options>, py::arg("name"))
      .def(
          "__setitem__",
          [](Options& self, const std::string& path, const py::object& value) {
            py::dict one;
            one[py::str(path)] = value;
            set_options(self, one);
          },
          py::arg("name"), py::arg("value"))
      .def(
          "set",
          [](Options& self, const py::object& values, const py::kwargs& more) {
            py::dict all;
            if (!values.is_none()) all = py::dict(values);
            for (const auto& [path, value] : more) all[path] = value;
            set_options(self, all);
          },
          py::arg("values") = py::none(),
          "Sets several options, from a dict, from keywords or from both. If one cannot be set, none is.")
      .def("describe", &described<Options>, py::arg("name"),
           "One option as a dict: name, value, unit, help, and what it accepts.")
      .def("keys", &paths_of<Options>, "The names of all options, in the order of docs/options.md.")
      .def(
          "items",
          [](Options& self) {
            py::list items;
            for (const OptionField& field : option_fields(self))
              items.append(py::make_tuple(field.path, to_python(field.get())));
            return items;
          },
          "Pairs of a name and a value, for all options.")
      .def("__iter__", [](Options& self) { return py::iter(paths_of(self)); })
      .def("__len__", [](Options& self) { return option_fields(self).size(); })
      .def("__contains__",
           [](Options& self, const std::string& path) {
             for (const OptionField& field : option_fields(self)) {
               if (field.path == path) return true;
             }
             return false;
           })
      .def(
          "__eq__",
          [](const Options& a, const Options& b) { return options_to_json(a) == options_to_json(b); },
          py::is_operator())
      .def(
          "copy", [](const Options& self) { return Options(self); }, "Options with the same values.")
      .def("__repr__", [name](Options& self) { return table_of(self, name); });
  kind.attr("__hash__") = py::none();
  return kind;
}

// Options whose names are keywords of the constructor.
template <class Options>
void add_plain_kind(py::module_& module, const char* name, const char* doc) {
  add_kind<Options>(module, name, doc).def(py::init([](const py::kwargs& values) {
    Options options;
    set_options(options, values);
    return options;
  }));
}

}  // namespace

py::object to_python(const OptionValue& value) {
  return std::visit(
      [](const auto& v) -> py::object {
        if constexpr (std::is_same_v<std::decay_t<decltype(v)>, std::vector<double>>) {
          py::tuple numbers(v.size());
          for (size_t i = 0; i < v.size(); ++i) numbers[i] = v[i];
          return numbers;
        } else {
          return py::cast(v);
        }
      },
      value);
}

void set_from_python(const std::vector<OptionField>& fields, const std::string& path, const py::handle& value,
                     std::string_view listed_by_command) {
  const OptionField& field = find_option(fields, path, option_word, listed_by_command);
  if (PyUnicode_Check(value.ptr())) {
    set_option_text(field, py::cast<std::string>(value), option_word);
  } else {
    set_option(field, value_of(field, value), option_word);
  }
}

void add_options(py::module_& module) {
  add_kind<TrainOptions>(
      module, "TrainOptions",
      "The options of a training, by the names of the command line and of TOML files, such as "
      "options[\"density.max_surfels\"] (docs/options.md). They are valid at all times.")
      .def(py::init([](const std::string& name, const py::kwargs& values) {
             TrainOptions options = preset(name);
             set_options(options, values);
             return options;
           }),
           py::arg("preset") = "paper");
  add_plain_kind<SynthOptions>(module, "SynthOptions", "The options of a synthetic capture (docs/synth.md).");
  add_plain_kind<CaptureOptions>(module, "CaptureOptions", "How a capture is read (docs/captures.md).");
  add_plain_kind<RenderOptions>(module, "RenderOptions",
                                "How a scene is rendered: the group `render` of TrainOptions. Lengths are "
                                "relative to the scene's extent.");
}

}  // namespace traceflow::python
