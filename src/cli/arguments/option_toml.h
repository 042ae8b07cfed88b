#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

#include "base/option_fields.h"

namespace traceflow::cli {

// Sets the fields that a TOML file names; groups are tables. Throws InputError with file, line and the
// command that lists the names, for unknown names and invalid values.
void options_from_toml(const std::filesystem::path& path, const std::vector<OptionField>& fields,
                       std::string_view listed_by = training_options_page);

}  // namespace traceflow::cli
