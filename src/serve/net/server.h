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
  std::string bind = "127.0.0.1";  // address of this machine to listen at, IPv4 or IPv6; not a name
  int port = 0;                    // 0: any that is free
  std::vector<std::string>
      allowed_hosts;     // NAME:PORT that the page may be asked for under, beside the bound address
  int connections = 32;  // at a time; a page takes one, and a few more while it loads

  // Throws InputError.
  void validate() const;
};

// Serves the viewer's page over HTTP and carries its messages over a WebSocket at /ws, on a thread of its
// own. Everything asked of it must carry the token of its address (docs/view.md, Safety).
class Server {
 public:
  // Starts to listen. page (embedded_files() of serve/net/page.h) and handler outlive the server. Throws
  // InputError when the address is not to be had.
  Server(const ServerOptions& options, std::span<const EmbeddedFile> page, MessageHandler& handler,
         const Limits& limits = {});
  // Ends all connections: when it returns, every client has left.
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
