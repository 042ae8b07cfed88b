#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

#include "base/option_fields.h"

namespace traceflow::cli {

// Writes the fields that a TOML file names; groups are tables. Unknown names and values that a field cannot
// hold throw InputError with file and line, and with the command that lists the names.
void options_from_toml(const std::filesystem::path& path, const std::vector<OptionField>& fields,
                       std::string_view listed_by = training_options_page);

}  // namespace traceflow::cli
