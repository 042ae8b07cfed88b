#pragma once

#include <string>

namespace CLI {
class App;
}

namespace traceflow::cli {

// The manual page of the program, or of the subcommand with this name, in man(7)'s macros. It has the text
// of `--help`. Throws InputError if there is none.
std::string man_page(const CLI::App& program, const std::string& name);

}  // namespace traceflow::cli
