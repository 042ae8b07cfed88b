#pragma once

#include <string>
#include <vector>

#include "base/option_fields.h"

namespace traceflow {

// An options struct as JSON text, with groups as objects and fields in their order: {"iterations": 60000,
// "loss": {"normal": 0.05}}. Checkpoints keep their settings in this form. Reading it back gives the same
// values, bit for bit.
std::string options_to_json(const std::vector<OptionField>& fields);

template <class Options>
requires requires(Options& o) { option_fields(o); }
std::string options_to_json(const Options& options) {
  Options copy = options;
  return options_to_json(option_fields(copy));
}

// Writes the fields that the text names; the others keep their values. Throws InputError beginning with
// `where` for text that is not a JSON object, unknown names, and values that a field cannot hold.
void options_from_json(const std::string& text, const std::vector<OptionField>& fields,
                       const std::string& where);

}  // namespace traceflow
