#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/embedded_file.h"
#include "base/options.h"
#include "serve/net/limits.h"
#include "serve/net/message_handler.h"

namespace traceflow::serve {

struct ServerOptions {
  std::string bind = "127.0.0.1";  // local IPv4 or IPv6 address to listen on; not a name
  int port = 0;                    // 0: any free port
  std::vector<std::string>
      allowed_hosts;     // values of Host (NAME:PORT) that requests may have besides the bound address
  int connections = 32;  // maximum at a time; a page uses one, and a few more while it loads

  // Throws InputError.
  void validate() const;
};

// The viewer's page and its files, from web/page/.
std::span<const EmbeddedFile> embedded_files();

// Serves the viewer's page over HTTP and its messages over a WebSocket at /ws, on its own thread. Every
// request must carry the token of the server's address (docs/view.md, Safety).
class Server {
 public:
  // Starts to listen. page and handler must outlive the server. Throws InputError if it cannot listen on the
  // address.
  Server(const ServerOptions& options, std::span<const EmbeddedFile> page, MessageHandler& handler,
         const Limits& limits = {});
  // Closes all connections. When it returns, every client is disconnected.
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  // The address to open: http://127.0.0.1:8080/?token=….
  const std::string& address() const;
  int port() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace traceflow::serve
