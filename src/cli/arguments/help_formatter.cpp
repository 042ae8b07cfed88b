#include "cli/arguments/help_formatter.h"

#include <set>

namespace traceflow::cli {

namespace {

std::string placeholder_of(const CLI::Option& option) {
  if (!option.get_option_text().empty()) return option.get_option_text();
  return option.get_type_size() == 0 ? "" : option.get_type_name();
}

std::string names_of(const std::set<CLI::Option*>& options) {
  std::string names;
  for (const CLI::Option* option : options) names += " " + option->get_name();
  return names;
}

}  // namespace

// CLI11 names a negated flag `--no-low-pass{false}`.
std::string HelpFormatter::make_option_name(const CLI::Option* option, bool is_positional) const {
  return CLI::detail::find_and_replace(CLI::Formatter::make_option_name(option, is_positional), "{false}",
                                       "");
}

std::string HelpFormatter::make_option_opts(const CLI::Option* option) const {
  std::string text = placeholder_of(*option);
  if (!text.empty()) text.insert(0, " ");
  if (option->get_required()) text += " REQUIRED";
  if (!option->get_envname().empty()) text += " (Env:" + option->get_envname() + ")";
  if (!option->get_needs().empty()) text += " Needs:" + names_of(option->get_needs());
  if (!option->get_excludes().empty()) text += " Excludes:" + names_of(option->get_excludes());
  return text;
}

std::string HelpFormatter::make_option_desc(const CLI::Option* option) const {
  const std::string value = option->get_default_str();
  return option->get_description() + (value.empty() ? "" : " [" + value + "]");
}

}  // namespace traceflow::cli
