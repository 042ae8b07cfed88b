#include "cli/arguments/option_arguments.h"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <deque>

#include "cli/arguments/option_toml.h"

namespace traceflow::cli {

namespace {

std::string kebab_case(std::string name) {
  std::replace(name.begin(), name.end(), '_', '-');
  return name;
}

bool has_flag(const OptionField& field, const std::vector<std::string>& promoted) {
  const size_t dot = field.path.find('.');
  if (dot == std::string::npos) return true;
  return field.path.find('.', dot + 1) == std::string::npos &&
         std::find(promoted.begin(), promoted.end(), field.path.substr(0, dot)) != promoted.end();
}

// What stands for the value in the help: "N", "X", the choices.
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

std::string help_text(const OptionField& field) {
  return field.unit.empty() ? field.full_help() : field.full_help() + " In " + field.unit + ".";
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
    }
    flag.option->group("Settings");
  }
  verb.add_option("--set", state_->assignments,
                  "Any option by its path, as in loss.normal=0; may be repeated")
      ->option_text("PATH=VALUE")
      ->expected(1)
      ->take_all()
      ->group("Settings");
  verb.add_option("--config", state_->config, "A TOML file of options; --set and flags come after it")
      ->option_text("FILE")
      ->group("Settings");
}

void OptionArguments::apply(const std::vector<OptionField>& fields) const {
  if (!state_->config.empty()) options_from_toml(state_->config, fields);
  for (const std::string& assignment : state_->assignments)
    set_option_assignment(fields, assignment, "--set");
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
