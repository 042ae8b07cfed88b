#include "cli/arguments/completion.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <vector>

namespace traceflow::cli {

namespace {

struct OptionWords {
  std::vector<std::string> names;  // "-o", "--output"
  std::string help;                // one line
  bool takes_value = false;
  std::vector<std::string> choices;
};

struct VerbWords {
  std::string name, help;  // the program itself has no name
  std::vector<OptionWords> options;
};

// What a menu has room for: the text up to its first stop that leaves more than a word.
std::string first_clause(const std::string& text) {
  constexpr size_t least = 12;
  constexpr std::string_view stops[] = {": ", "; ", ". ", " (", " [", ", as in"};
  size_t end = text.size();
  for (const std::string_view stop : stops) end = std::min(end, text.find(stop, least));
  std::string clause = text.substr(0, end);
  while (clause.ends_with('.')) clause.pop_back();
  return clause;
}

// CLI11 writes a check for choices into the type's name: "TEXT:{png,npy}".
std::vector<std::string> choices_of(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  const size_t open = type.find('{'), close = type.rfind('}');
  if (open == std::string::npos || close == std::string::npos) return {};
  return CLI::detail::split(type.substr(open + 1, close - open - 1), ',');
}

VerbWords words_of(const CLI::App& app, const std::string& name) {
  VerbWords verb{name, first_clause(app.get_description()), {}};
  for (const CLI::Option* option : app.get_options()) {
    OptionWords words;
    for (const std::string& letter : option->get_snames()) words.names.push_back("-" + letter);
    for (const std::string& word : option->get_lnames()) words.names.push_back("--" + word);
    if (words.names.empty()) continue;
    words.help = first_clause(option->get_description());
    words.takes_value = option->get_items_expected_max() > 0;
    words.choices = choices_of(*option);
    verb.options.push_back(std::move(words));
  }
  return verb;
}

std::vector<VerbWords> verbs_of(const CLI::App& program) {
  std::vector<VerbWords> verbs;
  for (const CLI::App* verb : program.get_subcommands(nullptr))
    verbs.push_back(words_of(*verb, verb->get_name()));
  return verbs;
}

std::vector<std::string> names_of(const std::vector<VerbWords>& verbs) {
  std::vector<std::string> names;
  names.reserve(verbs.size());
  for (const VerbWords& verb : verbs) names.push_back(verb.name);
  return names;
}

std::vector<std::string> names_of(const std::vector<OptionWords>& options) {
  std::vector<std::string> names;
  for (const OptionWords& option : options)
    names.insert(names.end(), option.names.begin(), option.names.end());
  return names;
}

std::string in_single_quotes(const std::string& text) {
  return "'" + CLI::detail::find_and_replace(text, "'", "'\\''") + "'";
}

// Cases "VERB:OPTION)" of the word before the one to complete.
std::string bash_values(const VerbWords& verb, const std::string& pattern) {
  std::string cases;
  for (const OptionWords& option : verb.options) {
    if (!option.takes_value) continue;
    std::vector<std::string> patterns;
    for (const std::string& name : option.names) patterns.push_back(pattern + ":" + name);
    cases += fmt::format("    {})\n      words='{}'\n      ;;\n", fmt::join(patterns, " | "),
                         fmt::join(option.choices, " "));
  }
  return cases;
}

std::string bash_script(const VerbWords& program, const std::vector<VerbWords>& verbs) {
  std::string values, options;
  for (const VerbWords& verb : verbs) {
    values += bash_values(verb, verb.name);
    options += fmt::format("        {}) words='{} {}' ;;\n", verb.name,
                           fmt::join(names_of(verb.options), " "), fmt::join(names_of(program.options), " "));
  }
  values += bash_values(program, "*");
  return fmt::format(R"(# Completion of traceflow in bash, written by `traceflow --completion bash`.
_traceflow() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD - 1]}} verb='' words='' i
  for ((i = 1; i < COMP_CWORD; ++i)); do
    case ${{COMP_WORDS[i]}} in
    {verbs_or}) verb=${{COMP_WORDS[i]}}; break ;;
    esac
  done
  COMPREPLY=()
  case $verb:$before in
{values}    *)
      if [[ $word != -* ]]; then
        [ -n "$verb" ] || words='{verbs}'
      else
        case $verb in
{options}        *) words='{globals}' ;;
        esac
      fi
      ;;
  esac
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$word")
  [[ ${{COMPREPLY[0]-}} != *= ]] || compopt -o nospace 2>/dev/null
}}
complete -o default -F _traceflow traceflow
)",
                     fmt::arg("verbs_or", fmt::join(names_of(verbs), " | ")), fmt::arg("values", values),
                     fmt::arg("verbs", fmt::join(names_of(verbs), " ")), fmt::arg("options", options),
                     fmt::arg("globals", fmt::join(names_of(program.options), " ")));
}

// An argument of zsh's _arguments: "'(-o --output)'{-o,--output}'[Output folder]:value:_files'".
std::string zsh_argument(const OptionWords& option) {
  std::string help = option.help;
  for (const char* special : {"\\", "[", "]", ":"})
    help = CLI::detail::find_and_replace(help, special, std::string("\\") + special);
  std::string text = "[" + help + "]";
  if (option.takes_value) {
    const std::string choices = fmt::format("{}", fmt::join(option.choices, " "));
    if (choices.empty()) {
      text += ":value:_files";
    } else if (choices.ends_with('=')) {
      text += ":value:compadd -S '' " + choices;
    } else {
      text += ":value:(" + choices + ")";
    }
  }
  std::string names = fmt::format("{}", fmt::join(option.names, ","));
  if (option.names.size() > 1) names = "{" + names + "}";
  return names + in_single_quotes(text);
}

std::string zsh_script(const VerbWords& program, const std::vector<VerbWords>& verbs) {
  const auto arguments = [](const VerbWords& verb) {
    std::string text;
    for (const OptionWords& option : verb.options) text += " \\\n          " + zsh_argument(option);
    return text;
  };
  std::string menu, cases;
  for (const VerbWords& verb : verbs) {
    menu += "        " + in_single_quotes(verb.name + ":" + verb.help) + "\n";
    cases +=
        fmt::format("        {})\n          _arguments{}{} \\\n          '*:file:_files'\n          ;;\n",
                    verb.name, arguments(verb), arguments(program));
  }
  return fmt::format(R"(#compdef traceflow
# Completion of traceflow in zsh, written by `traceflow --completion zsh`.
_traceflow() {{
  local curcontext=$curcontext state line
  typeset -A opt_args
  _arguments -C{} \
          '1: :->verb' \
          '*:: :->arguments'
  case $state in
    verb)
      local -a verbs=(
{}      )
      _describe verb verbs
      ;;
    arguments)
      case $line[1] in
{}      esac
      ;;
  esac
}}
_traceflow "$@"
)",
                     arguments(program), menu, cases);
}

std::string fish_option(const OptionWords& option, const std::string& condition) {
  std::string text = "complete -c traceflow" + condition;
  for (const std::string& name : option.names)
    text += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
  if (option.takes_value) text += " -r";
  if (!option.choices.empty())
    text += fmt::format(" -f -a {}", in_single_quotes(fmt::format("{}", fmt::join(option.choices, " "))));
  return text + " -d " + in_single_quotes(option.help) + "\n";
}

std::string fish_script(const VerbWords& program, const std::vector<VerbWords>& verbs) {
  std::string text = "# Completion of traceflow in fish, written by `traceflow --completion fish`.\n";
  for (const OptionWords& option : program.options) text += fish_option(option, "");
  for (const VerbWords& verb : verbs) {
    text += fmt::format("complete -c traceflow -n __fish_use_subcommand -f -a {} -d {}\n", verb.name,
                        in_single_quotes(verb.help));
  }
  for (const VerbWords& verb : verbs) {
    for (const OptionWords& option : verb.options) {
      // Every verb has the program's options too.
      if (std::ranges::none_of(program.options,
                               [&](const OptionWords& o) { return o.names == option.names; }))
        text += fish_option(option, " -n '__fish_seen_subcommand_from " + verb.name + "'");
    }
  }
  return text;
}

}  // namespace

std::string completion_script(const CLI::App& program, Shell shell) {
  const VerbWords own = words_of(program, "");
  const std::vector<VerbWords> verbs = verbs_of(program);
  switch (shell) {
    case Shell::bash:
      return bash_script(own, verbs);
    case Shell::zsh:
      return zsh_script(own, verbs);
    case Shell::fish:
      return fish_script(own, verbs);
  }
  return "";
}

}  // namespace traceflow::cli
