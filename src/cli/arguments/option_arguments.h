#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/option_fields.h"

namespace CLI {
class App;
}

namespace traceflow::cli {

// An options struct on a verb's command line: a flag for every field that stands in no group or in one of the
// `promoted` groups (`--save-every N`, `--no-low-pass`), `--set loss.normal=0` for every field, and `--config
// FILE.toml`. The help shows what the fields hold at that time as their defaults.
//
//   auto options = std::make_shared<TrainOptions>();
//   OptionArguments arguments(*verb, option_fields(*options), {"capture"});
//   verb->callback([=] { arguments.apply(option_fields(*options)); options->validate(); … });
class OptionArguments {
 public:
  OptionArguments(CLI::App& verb, const std::vector<OptionField>& fields,
                  const std::vector<std::string>& promoted = {});

  // After parsing: writes what was given, the file first, then --set, then the flags. Throws InputError.
  void apply(const std::vector<OptionField>& fields) const;

 private:
  struct State;
  std::shared_ptr<State> state_;
};

}  // namespace traceflow::cli
