#pragma once

#include <memory>
#include <string>

#include "base/device.h"

namespace CLI {
class App;
}

namespace traceflow::cli {

// Where a verb runs: `--device auto|cpu|cuda` and `--deterministic`.
class DeviceArguments {
 public:
  explicit DeviceArguments(CLI::App& verb);

  // After parsing: the device, told on stderr with the reason, unless quiet. Throws InputError where cuda is
  // asked for and none answers.
  Device choose(bool quiet = false) const;

 private:
  struct State;
  std::shared_ptr<State> state_;
};

}  // namespace traceflow::cli
