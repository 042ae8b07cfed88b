#include "cli/arguments/man_page.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/version.h"
#include "cli/arguments/help_formatter.h"
#include "cli/terminal/error_boundary.h"

namespace traceflow::cli {

namespace {

// Text as roff prints it: no escapes, no hyphens in names that are typed, no request at the start of a line.
std::string roff(const std::string& text) {
  std::string escaped = CLI::detail::find_and_replace(text, "\\", "\\e");
  escaped = CLI::detail::find_and_replace(escaped, "-", "\\-");
  if (escaped.starts_with('.') || escaped.starts_with('\'')) escaped.insert(0, "\\&");
  return CLI::detail::find_and_replace(escaped, "\n.", "\n\\&.");
}

std::string upper_case(std::string text) {
  for (char& c : text)
    if (c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
  return text;
}

std::string entry(const CLI::Option& option, bool positional) {
  const HelpFormatter formatter;
  return fmt::format(".TP\n\\fB{}\\fR{}\n{}\n", roff(formatter.make_option_name(&option, positional)),
                     roff(formatter.make_option_opts(&option)), roff(formatter.make_option_desc(&option)));
}

std::string section(const std::string& title, const std::vector<const CLI::Option*>& options,
                    bool positional) {
  std::string text;
  for (const CLI::Option* option : options) text += entry(*option, positional);
  return text.empty() ? "" : fmt::format(".SH {}\n{}", upper_case(title), text);
}

std::string synopsis(const CLI::App& app, const std::string& command, bool has_verbs) {
  std::string text = fmt::format(".B {}\n[OPTIONS]", roff(command));
  for (const CLI::Option* option : app.get_options([](const CLI::Option* o) { return o->get_positional(); }))
    text += (option->get_required() ? " " : " [") + roff(option->get_name(true)) +
            (option->get_required() ? "" : "]");
  return text + (has_verbs ? " SUBCOMMAND ..." : "") + "\n";
}

std::string see_also(const CLI::App& program, const CLI::App& app) {
  std::vector<std::string> pages;
  if (&app != &program) pages.emplace_back("traceflow");
  for (const CLI::App* other : program.get_subcommands(nullptr))
    if (other != &app) pages.push_back("traceflow-" + other->get_name());
  std::string text = ".SH SEE ALSO\n";
  for (size_t i = 0; i < pages.size(); ++i)
    text += fmt::format(".BR {} (1){}\n", roff(pages[i]), i + 1 < pages.size() ? "," : "");
  return text;
}

std::string exit_codes() {
  std::string text = ".SH EXIT STATUS\n";
  for (const auto& [code, meaning] : {std::pair{exit_done, "done"},
                                      {exit_input, "unusable input or arguments"},
                                      {exit_internal, "a failed internal check: please report it"},
                                      {exit_memory, "out of memory"},
                                      {exit_diverged, "a training diverged or collapsed"},
                                      {exit_interrupted, "stopped by Ctrl\\-C, with its state saved"}})
    text += fmt::format(".TP\n\\fB{}\\fR\n{}\n", code, meaning);
  return text;
}

const CLI::App& app_named(const CLI::App& program, const std::string& name) {
  if (name == program.get_name()) return program;
  std::vector<std::string> names{program.get_name()};
  for (const CLI::App* app : program.get_subcommands(nullptr)) {
    if (app->get_name() == name) return *app;
    names.push_back(app->get_name());
  }
  throw InputError("option", "man", name, fmt::format("one of {}", fmt::join(names, ", ")));
}

}  // namespace

std::string man_page(const CLI::App& program, const std::string& name) {
  const CLI::App& app = app_named(program, name);
  const bool of_program = &app == &program;
  const std::string command = of_program ? name : program.get_name() + " " + name;
  const std::string page = of_program ? name : program.get_name() + "-" + name;
  std::string purpose = app.get_description();
  if (purpose.ends_with('.')) purpose.pop_back();

  std::string text =
      fmt::format(".TH {} 1 \"\" \"traceflow {}\" \"TraceFlow\"\n", upper_case(page), version());
  text += fmt::format(".SH NAME\n{} \\- {}\n", roff(page), roff(purpose));
  text += ".SH SYNOPSIS\n" + synopsis(app, command, of_program);
  text +=
      section("arguments", app.get_options([](const CLI::Option* o) { return o->get_positional(); }), true);
  for (const std::string& group : app.get_groups()) {
    if (group.empty()) continue;
    text += section(group, app.get_options([&](const CLI::Option* o) {
      return o->nonpositional() && o->get_group() == group;
    }),
                    false);
  }
  if (of_program) {
    text += ".SH SUBCOMMANDS\n";
    for (const CLI::App* other : program.get_subcommands(nullptr))
      text += fmt::format(".TP\n\\fB{}\\fR\n{}\n", roff(other->get_name()), roff(other->get_description()));
  } else {
    text += section("options of every subcommand", program.get_options([](const CLI::Option* o) {
      return !o->get_group().empty() && o->get_items_expected_max() > 0;
    }),
                    false);
  }
  return text + exit_codes() + see_also(program, app);
}

}  // namespace traceflow::cli
