#include "cli/program.h"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "base/option_fields.h"
#include "base/parallel.h"
#include "base/printable.h"
#include "base/profile.h"
#include "cli/arguments/completion.h"
#include "cli/arguments/help_formatter.h"
#include "cli/arguments/man_page.h"
#include "cli/arguments/option_page.h"
#include "cli/arguments/version_page.h"
#include "cli/terminal/error_boundary.h"
#include "cli/terminal/standard_streams.h"
#include "cli/verbs/verbs.h"
#include "primitives/instructions.h"

namespace traceflow::cli {

namespace {

// Arguments that every verb has.
struct GlobalArguments {
  int threads = 0;
  std::string instructions = "automatic";
  bool profile = false;
  bool help_options = false;
  std::string completion, man;
};

void add_global_arguments(CLI::App& program, GlobalArguments& arguments) {
  program.set_version_flag("--version", version_page,
                           "Print the version, and those of the compiler and the libraries, and exit");
  program.add_flag("--help-options", arguments.help_options,
                   "Print all training options with their values in each preset, and exit");
  constexpr auto shells = enum_names(Shell{});
  program
      .add_option("--completion", arguments.completion,
                  "Print a script that completes command lines in bash, zsh or fish, and exit")
      ->check(CLI::IsMember(std::vector<std::string>(shells.begin(), shells.end())))
      ->option_text("SHELL");
  program
      .add_option("--man", arguments.man,
                  "Print the manual page of traceflow or of a subcommand for man(1), and exit")
      ->option_text("NAME");
  program
      .add_option("--threads", arguments.threads,
                  "Number of threads; 0: OMP_NUM_THREADS or all cores. The results do not depend on it")
      ->check(CLI::Range(0, 4096))
      ->option_text("N");
  constexpr auto names = enum_names(Instructions{});
  program
      .add_option("--instructions", arguments.instructions,
                  "Highest level of vector instructions to use: automatic (all that the processor has), "
                  "sse4, avx2 or avx512. Different processors give the same bytes with the same limit")
      ->check(CLI::IsMember(std::vector<std::string>(names.begin(), names.end())))
      ->option_text("NAME");
  program.add_flag("--profile", arguments.profile, "Print how much time each part of the program took");
}

// The value of a choice that CLI11 has checked.
template <class Choice>
Choice choice_of(const std::string& name) {
  constexpr auto names = enum_names(Choice{});
  return static_cast<Choice>(std::ranges::find(names, name) - names.begin());
}

void print_profile() {
  std::cerr << fmt::format("{:<40} {:>10} {:>12} {:>12}\n", "step", "calls", "seconds", "ms/call");
  for (const profile::Entry& e : profile::entries()) {
    std::cerr << fmt::format("{:<40} {:>10} {:>12.3f} {:>12.3f}\n", e.name, e.calls, e.seconds,
                             1e3 * e.seconds / static_cast<double>(std::max<int64_t>(1, e.calls)));
  }
}

// Help and version are not errors. Every error becomes one line.
int finish_parse(const CLI::App& program, const CLI::ParseError& error) {
  if (error.get_exit_code() == 0) return program.exit(error);
  const auto verbs = program.get_subcommands();
  const std::string name = verbs.empty() ? "traceflow" : "traceflow " + verbs.front()->get_name();
  // The message quotes the arguments.
  constexpr size_t longest = 1000;
  std::cerr << "traceflow: " << printable(error.what(), longest) << "; see `" << name << " --help`"
            << std::endl;
  return exit_input;
}

int run_program(int argc, const char* const* argv) {
  CLI::App program("Reconstructs moving specular scenes from video with 2D Gaussian surfels.", "traceflow");
  program.formatter(std::make_shared<HelpFormatter>());
  program.fallthrough();
  program.require_subcommand(0, 1);
  GlobalArguments arguments;
  add_global_arguments(program, arguments);
  program.parse_complete_callback([&arguments] {
    set_threads(arguments.threads);
    limit_instructions(choice_of<Instructions>(arguments.instructions));
    profile::enable(arguments.profile);
  });
  add_verbs(program);
  try {
    program.parse(argc, argv);
  } catch (const Exit&) {
    if (arguments.profile) print_profile();
    throw;
  } catch (const CLI::ParseError& error) {
    return finish_parse(program, error);
  }
  if (arguments.help_options) {
    std::cout << option_page();
    return exit_done;
  }
  if (!arguments.completion.empty()) {
    std::cout << completion_script(program, choice_of<Shell>(arguments.completion));
    return exit_done;
  }
  if (!arguments.man.empty()) {
    std::cout << man_page(program, arguments.man);
    return exit_done;
  }
  if (program.get_subcommands().empty()) {
    std::cerr << program.help();
    return exit_input;
  }
  if (arguments.profile) print_profile();
  return exit_done;
}

}  // namespace

int run(int argc, const char* const* argv) {
  const int code = guarded([&] { return run_program(argc, argv); }, std::cerr);
  return flush_output(std::cerr) || code != exit_done ? code : exit_input;
}

}  // namespace traceflow::cli
