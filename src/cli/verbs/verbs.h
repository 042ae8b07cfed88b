#pragma once

namespace CLI {
class App;
}

// The program's verbs, one file each. NAME.cpp defines add_NAME; the build generates add_verbs from the
// existing files. Each function adds its subcommand, whose callback does the work. Errors are exceptions up
// to the error boundary (error_boundary.h), which prints one line and chooses the exit code.
namespace traceflow::cli {

void add_train(CLI::App& program);
void add_eval(CLI::App& program);
void add_render(CLI::App& program);
void add_report(CLI::App& program);
void add_trace(CLI::App& program);
void add_export(CLI::App& program);
void add_synth(CLI::App& program);
void add_inspect(CLI::App& program);
void add_prepare(CLI::App& program);
void add_attach_priors(CLI::App& program);
void add_view(CLI::App& program);

// Adds all verbs, in alphabetical order.
void add_verbs(CLI::App& program);

}  // namespace traceflow::cli
