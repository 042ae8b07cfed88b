#pragma once

namespace CLI {
class App;
}

// The program's verbs, one file each (verb_NAME.cpp). Every function adds its subcommand to the program; the subcommand's
// callback does the work. Errors travel as exceptions to main.cpp, which prints one line and chooses the exit code.
namespace traceflow::cli {

void add_train(CLI::App& program);
void add_eval(CLI::App& program);
void add_render(CLI::App& program);
void add_trace(CLI::App& program);
void add_export(CLI::App& program);
void add_synth(CLI::App& program);
void add_inspect(CLI::App& program);

}  // namespace traceflow::cli
