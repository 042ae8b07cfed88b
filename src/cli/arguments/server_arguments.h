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
  // needs: a flag without which these make no sense, or null.
  explicit ServerArguments(CLI::App& verb, CLI::Option* needs = nullptr);

  // Starts the server, and says on standard output where to look and how from another machine. Where no port
  // was asked for and the usual one is taken, it takes any. Throws InputError.
  std::unique_ptr<serve::Server> start(serve::MessageHandler& handler) const;

 private:
  struct State;
  std::shared_ptr<State> state_;
};

}  // namespace traceflow::cli
