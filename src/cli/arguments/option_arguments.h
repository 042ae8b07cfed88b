#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/option_fields.h"

namespace CLI {
class App;
}

namespace traceflow::cli {

// An options struct on a verb's command line. Each field in no group or in a `promoted` group has a flag
// (`--save-every N`, `--no-low-pass`). `--set loss.normal=0` sets any field, and `--config FILE.toml` reads a
// file. The help shows the fields' present values as defaults.
//
//   auto options = std::make_shared<TrainOptions>();
//   OptionArguments arguments(*verb, option_fields(*options), {"capture"});
//   verb->callback([=] { arguments.apply(option_fields(*options)); options->validate(); … });
class OptionArguments {
 public:
  OptionArguments(CLI::App& verb, const std::vector<OptionField>& fields,
                  const std::vector<std::string>& promoted = {});

  // After parsing: sets the given values, first from the file, then from --set, then from the flags. Throws
  // InputError.
  void apply(const std::vector<OptionField>& fields) const;

 private:
  struct State;
  std::shared_ptr<State> state_;
};

}  // namespace traceflow::cli
