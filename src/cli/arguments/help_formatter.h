#pragma once

#include <CLI/CLI.hpp>

#include <string>

namespace traceflow::cli {

// Formats an option in a verb's help: `-o,--output RUN REQUIRED`, its purpose, and its default in brackets.
// CLI11's own formatter omits all that if an option has a placeholder.
class HelpFormatter : public CLI::Formatter {
 public:
  std::string make_option_name(const CLI::Option* option, bool is_positional) const override;
  std::string make_option_opts(const CLI::Option* option) const override;
  std::string make_option_desc(const CLI::Option* option) const override;
};

}  // namespace traceflow::cli
