#pragma once

#include <memory>
#include <string>

#include "serve/net/server.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace traceflow::cli {

// Where the viewer's server listens: --port, --bind, --allow-host.
class ServerArguments {
 public:
  // needs: a flag that these require, or null.
  explicit ServerArguments(CLI::App& verb, CLI::Option* needs = nullptr);

  // Starts the server and prints its address, and how to reach it from another machine, to standard output.
  // If the default port is taken and no port was requested, uses any free one. Throws InputError.
  std::unique_ptr<serve::Server> start(serve::MessageHandler& handler) const;

 private:
  struct State;
  std::shared_ptr<State> state_;
};

}  // namespace traceflow::cli
