#pragma once

#include <filesystem>
#include <vector>

#include "base/option_fields.h"

namespace traceflow::cli {

// Writes the fields that a TOML file names; groups are tables. Unknown names and values that a field cannot
// hold throw InputError with file and line.
void options_from_toml(const std::filesystem::path& path, const std::vector<OptionField>& fields);

}  // namespace traceflow::cli
