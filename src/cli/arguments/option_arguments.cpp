#include "cli/arguments/option_arguments.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <deque>

#include "cli/arguments/option_toml.h"

namespace traceflow::cli {

namespace {

std::string kebab_case(std::string name) {
  std::ranges::replace(name, '_', '-');
  return name;
}

bool has_flag(const OptionField& field, const std::vector<std::string>& promoted) {
  const size_t dot = field.path.find('.');
  if (dot == std::string::npos) return true;
  return field.path.find('.', dot + 1) == std::string::npos &&
         std::ranges::find(promoted, field.path.substr(0, dot)) != promoted.end();
}

// Placeholder of the value in the help: "N", "X" or the choices.
std::string placeholder(const OptionField& field) {
  switch (field.kind) {
    case OptionKind::boolean:
      return "";
    case OptionKind::integer:
      return "N";
    case OptionKind::number:
      return "X";
    case OptionKind::text:
      return "TEXT";
    case OptionKind::three_numbers:
      return "X,Y,Z";
    case OptionKind::choice:
      return "CHOICE";
  }
  return "";
}

// The help text with the default value.
std::string help_text(const OptionField& field) {
  const std::string value = option_text(field.get());
  if (value.empty()) return field.full_help();
  return fmt::format("{} [{}{}{}]", field.full_help(), value, field.unit.empty() ? "" : " ", field.unit);
}

// Paths that only --set can set.
std::vector<std::string> paths_without_flag(const std::vector<OptionField>& fields,
                                            const std::vector<std::string>& promoted) {
  std::vector<std::string> paths;
  for (const OptionField& field : fields) {
    if (!has_flag(field, promoted)) paths.push_back(field.path);
  }
  return paths;
}

// The page of all options lists the rest.
constexpr size_t most_listed = 5;

// An example for --set that changes nothing, if possible for an option that only --set can set.
std::string example_of(const std::vector<OptionField>& fields, const std::vector<std::string>& without_flag) {
  for (const OptionField& field : fields) {
    const std::string value = option_text(field.get());
    if (!value.empty() && (without_flag.empty() || field.path == without_flag.front()))
      return field.path + "=" + value;
  }
  return "PATH=VALUE";
}

std::string help_of_set(const std::vector<OptionField>& fields,
                        const std::vector<std::string>& without_flag) {
  std::string what = "Any of these";
  if (without_flag.size() > most_listed) {
    what = fmt::format("Any option that `{}` lists", training_options_page);
  } else if (!without_flag.empty()) {
    what = fmt::format("Any of these and {}", fmt::join(without_flag, ", "));
  }
  return fmt::format("{}, as in {}; may be repeated", what, example_of(fields, without_flag));
}

std::string names_for_completion(const std::vector<OptionField>& fields) {
  std::vector<std::string> names;
  names.reserve(fields.size());
  for (const OptionField& field : fields) names.push_back(field.path + "=");
  return fmt::format("{{{}}}", fmt::join(names, ","));
}

}  // namespace

struct OptionArguments::State {
  struct Flag {
    std::string path;
    std::string text;
    bool on = false;
    CLI::Option* option = nullptr;
  };
  std::deque<Flag> flags;  // CLI11 keeps references to its elements
  std::vector<std::string> assignments;
  std::string config;
  std::string listed_by;  // the command that lists the names of all options
};

OptionArguments::OptionArguments(CLI::App& verb, const std::vector<OptionField>& fields,
                                 const std::vector<std::string>& promoted)
    : state_(std::make_shared<State>()) {
  for (const OptionField& field : fields) {
    if (!has_flag(field, promoted)) continue;
    const std::string name = kebab_case(field.name());
    State::Flag& flag = state_->flags.emplace_back();
    flag.path = field.path;
    if (field.kind == OptionKind::boolean) {
      flag.option = verb.add_flag("--" + name + ",!--no-" + name, flag.on, help_text(field));
    } else {
      flag.option =
          verb.add_option((name == "iterations" ? "-i,--" : "--") + name, flag.text, help_text(field))
              ->option_text(placeholder(field));
      // Completion reads it.
      if (!field.choices.empty())
        flag.option->type_name(fmt::format("{{{}}}", fmt::join(field.choices, ",")));
    }
    flag.option->group("Settings");
  }
  const std::vector<std::string> without_flag = paths_without_flag(fields, promoted);
  state_->listed_by = without_flag.size() > most_listed ? std::string(training_options_page)
                                                        : "traceflow " + verb.get_name() + " --help";
  verb.add_option("--set", state_->assignments, help_of_set(fields, without_flag))
      ->option_text("PATH=VALUE")
      ->type_name(names_for_completion(fields))
      ->expected(1)
      ->take_all()
      ->group("Settings");
  verb.add_option("--config", state_->config, "TOML file of options; --set and flags override it")
      ->option_text("FILE")
      ->group("Settings");
}

void OptionArguments::apply(const std::vector<OptionField>& fields) const {
  if (!state_->config.empty()) options_from_toml(state_->config, fields, state_->listed_by);
  for (const std::string& assignment : state_->assignments)
    set_option_assignment(fields, assignment, "--set", state_->listed_by);
  for (const State::Flag& flag : state_->flags) {
    if (flag.option->count() == 0) continue;
    const OptionField& field = find_option(fields, flag.path, "command line");
    const std::string where = "--" + kebab_case(field.name());
    if (field.kind == OptionKind::boolean) {
      set_option(field, flag.on, where);
    } else {
      set_option_text(field, flag.text, where);
    }
  }
}

}  // namespace traceflow::cli
