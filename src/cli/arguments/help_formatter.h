#pragma once

#include <CLI/CLI.hpp>

#include <string>

namespace traceflow::cli {

// An option's lines in a verb's help: `-o,--output RUN REQUIRED`, what it is for, its default in brackets.
// CLI11's own formatter leaves out all of that where an option has a placeholder.
class HelpFormatter : public CLI::Formatter {
 public:
  std::string make_option_name(const CLI::Option* option, bool is_positional) const override;
  std::string make_option_opts(const CLI::Option* option) const override;
  std::string make_option_desc(const CLI::Option* option) const override;
};

}  // namespace traceflow::cli
