#pragma once

#include <string>
#include <vector>

#include "base/option_fields.h"

namespace traceflow::cli {

// One column of values in a table of options: a preset, or the defaults.
struct OptionColumn {
  std::string title;
  std::vector<OptionField> fields;  // the same paths in every column
};

// A markdown table: option, a value for each column, unit, help.
std::string option_table(const std::vector<OptionColumn>& columns);

// docs/options.md: every option of a training, with its value in every preset.
std::string option_page();

}  // namespace traceflow::cli
