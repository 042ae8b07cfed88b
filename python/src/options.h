#pragma once

#include <pybind11/pybind11.h>

#include <string>
#include <vector>

#include "base/option_fields.h"
#include "capture/synth/synth.h"

namespace traceflow::python {

namespace py = pybind11;

// The command whose help lists options of a kind, for messages about names that there are not.
template <class Options>
constexpr std::string_view listed_by = training_options_page;
template <>
inline constexpr std::string_view listed_by<SynthOptions> = "traceflow synth --help";

// Writes a Python value to a field: text as on the command line, numbers, bools, and three numbers. Throws
// InputError if the field cannot hold it.
void set_from_python(const std::vector<OptionField>& fields, const std::string& path, const py::handle& value,
                     std::string_view listed_by);

py::object to_python(const OptionValue& value);

// Sets options by their names, all or, if one cannot be set or they do not fit each other, none.
template <class Options>
void set_options(Options& options, const py::dict& values) {
  Options changed = options;
  const std::vector<OptionField> fields = option_fields(changed);
  for (const auto& [name, value] : values)
    set_from_python(fields, py::cast<std::string>(py::str(name)), value, listed_by<Options>);
  changed.validate();
  options = changed;
}

}  // namespace traceflow::python
