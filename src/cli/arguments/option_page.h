#pragma once

#include <string>
#include <vector>

#include "base/option_fields.h"

namespace traceflow::cli {

// One column of values in the table of options: a preset, or the defaults.
struct OptionColumn {
  std::string title;
  std::vector<OptionField> fields;  // the same paths in every column
};

// A markdown table: option, its value in each column, unit, help.
std::string option_table(const std::vector<OptionColumn>& columns);

// docs/options.md: every training option with its value in every preset.
std::string option_page();

}  // namespace traceflow::cli
