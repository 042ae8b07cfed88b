#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/embedded_file.h"
#include "base/options.h"
#include "serve/net/room.h"

namespace traceflow::serve {

struct ServerOptions {
  std::string bind = "127.0.0.1";
  int port = 0;
  std::vector<std::string> allowed_hosts;  // NAME:PORT that pages may be asked for under, beside the bound address
  int connections = 16;

  void validate() const;
};

// Serves the viewer's page over HTTP and carries its messages over a WebSocket at /ws, on a thread of its own. Everything
// asked of it must carry the token of its address (docs/view.md, Safety).
class Server {
 public:
  // Starts to listen. port 0: any that is free. room outlives the server. Throws InputError when the address is not to be had.
  Server(const ServerOptions& options, std::span<const EmbeddedFile> page, Room& room);
  // Ends all connections.
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  // What to open: http://127.0.0.1:8080/?token=….
  const std::string& address() const;
  int port() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace traceflow::serve
