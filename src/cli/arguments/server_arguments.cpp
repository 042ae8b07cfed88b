#include "cli/arguments/server_arguments.h"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <cstdio>
#include <optional>

#include "base/error.h"

namespace traceflow::cli {

namespace {

constexpr int usual_port = 7180;

}  // namespace

struct ServerArguments::State {
  std::string bind = "127.0.0.1";
  std::optional<int> port;
  std::vector<std::string> allowed_hosts;
};

ServerArguments::ServerArguments(CLI::App& verb, CLI::Option* needs) : state_(std::make_shared<State>()) {
  const auto for_viewer = [&](CLI::Option* option) {
    if (needs != nullptr) option->needs(needs);
    return option;
  };
  for_viewer(verb.add_option("--port", state_->port,
                             "Port of the viewer's page; 0: any free port [7180, or any free port]"))
      ->check(CLI::Range(0, 65535))
      ->option_text("PORT");
  for_viewer(
      verb.add_option("--bind", state_->bind,
                      "Address to listen on; any address but 127.0.0.1 can be reached from other machines"))
      ->option_text("ADDRESS")
      ->capture_default_str();
  for_viewer(verb.add_option("--allow-host", state_->allowed_hosts,
                             "NAME:PORT in the page's address, if it is not the server's own, as behind a "
                             "proxy; may be repeated"))
      ->option_text("NAME:PORT");
}

std::unique_ptr<serve::Server> ServerArguments::start(serve::MessageHandler& handler) const {
  serve::ServerOptions options;
  options.bind = state_->bind;
  options.allowed_hosts = state_->allowed_hosts;
  options.port = state_->port.value_or(usual_port);
  const auto listen = [&] {
    return std::make_unique<serve::Server>(options, serve::embedded_files(), handler);
  };
  std::unique_ptr<serve::Server> server;
  try {
    server = listen();
  } catch (const InputError&) {
    // With --bind or --allow-host, other parties rely on the port.
    const bool as_usual = state_->allowed_hosts.empty() && state_->bind == serve::ServerOptions().bind;
    if (state_->port || !as_usual) throw;
    options.port = 0;
    server = listen();
  }
  fmt::print("view: {}\n", server->address());
  if (state_->bind == serve::ServerOptions().bind)
    fmt::print("      from elsewhere: ssh -L {0}:127.0.0.1:{0} THIS-MACHINE, then the same address\n",
               server->port());
  std::fflush(stdout);  // for a process that reads the address from a pipe
  return server;
}

}  // namespace traceflow::cli
