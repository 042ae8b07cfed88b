#pragma once

#include <array>
#include <string>
#include <string_view>

namespace CLI {
class App;
}

namespace traceflow::cli {

enum class Shell { bash, zsh, fish };
constexpr std::array<std::string_view, 3> enum_names(Shell) { return {"bash", "zsh", "fish"}; }

// A script that completes the verbs of `program`, their options and the choices of these, in `shell`. What
// has no choices is completed as a file's name.
std::string completion_script(const CLI::App& program, Shell shell);

}  // namespace traceflow::cli
