#pragma once

#include <memory>
#include <string>

#include "base/device.h"

namespace CLI {
class App;
}

namespace traceflow::cli {

// The CUDA device and its memory, or why there is none.
std::string cuda_text();

// The device of a verb: `--device auto|cpu|cuda` and `--deterministic`.
class DeviceArguments {
 public:
  explicit DeviceArguments(CLI::App& verb);

  // After parsing: the chosen device. Unless quiet, prints it with the reason to stderr. Throws InputError if
  // cuda is requested and not available.
  Device choose(bool quiet = false) const;

 private:
  struct State;
  std::shared_ptr<State> state_;
};

}  // namespace traceflow::cli
