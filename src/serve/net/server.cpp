#include "serve/net/server.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <pthread.h>

#include <algorithm>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <csignal>
#include <thread>

#include "serve/net/http_session.h"
#include "serve/net/token.h"

namespace traceflow::serve {

namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using boost::system::error_code;
using Acceptor = asio::basic_socket_acceptor<tcp, Executor>;

// Connections above the limit that are still answered, with status 503.
constexpr size_t spare_connections = 8;

[[noreturn]] void refuse(const ServerOptions& options, const error_code& error) {
  if (error == asio::error::address_in_use) {
    throw InputError("option", "port", fmt::format("{}, which another program has", options.port),
                     "a free port", "--port 0 takes any that is free");
  }
  if (error == asio::error::access_denied) {
    throw InputError("option", "port", fmt::format("{}, which only the administrator may open", options.port),
                     "a port from 1024 on");
  }
  throw InputError("option", "bind", fmt::format("{} ({})", options.bind, error.message()),
                   "an address of this machine");
}

// Child processes must not inherit the connections.
void close_on_exec(int handle) { fcntl(handle, F_SETFD, FD_CLOEXEC); }

Acceptor listen(asio::io_context& io, const ServerOptions& options) {
  options.validate();
  const tcp::endpoint where(asio::ip::make_address(options.bind), static_cast<uint16_t>(options.port));
  Acceptor acceptor(io);
  error_code error;
  acceptor.open(where.protocol(), error);
  if (!error) close_on_exec(acceptor.native_handle());
  // Without it the port would be unavailable for a minute after the server has ended (TIME_WAIT).
  if (!error) acceptor.set_option(tcp::acceptor::reuse_address(true), error);
  if (!error) acceptor.bind(where, error);
  if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
  if (error) refuse(options, error);
  return acceptor;
}

// The accepted values of Host; the first one is printed. Only the user knows which names resolve to this
// machine from outside (allowed_hosts).
std::vector<std::string> host_names(const ServerOptions& options, const tcp::endpoint& bound) {
  std::vector<std::string> names;
  const auto add = [&](const std::string& name) {
    names.push_back(fmt::format("{}:{}", name, bound.port()));
  };
  const auto address = bound.address();
  if (address.is_unspecified()) {
    names = options.allowed_hosts;
    add("127.0.0.1");
  } else {
    add(address.is_v6() ? "[" + address.to_string() + "]" : address.to_string());
    names.insert(names.end(), options.allowed_hosts.begin(), options.allowed_hosts.end());
  }
  if (address.is_unspecified() || address.is_loopback()) add("localhost");
  if (address.is_unspecified() && address.is_v6()) add("[::1]");
  // Browsers omit HTTP's default port in Host.
  for (size_t i = 0, count = names.size(); i < count; ++i) {
    if (names[i].ends_with(":80")) names.push_back(names[i].substr(0, names[i].size() - 3));
  }
  return names;
}

}  // namespace

struct Server::State {
  State(const ServerOptions& options, std::span<const EmbeddedFile> page, MessageHandler& handler,
        const Limits& limits)
      : acceptor(listen(io, options)),
        retry(io.get_executor()),
        connections(static_cast<size_t>(options.connections)),
        port(acceptor.local_endpoint().port()),
        shared(make_shared_state(options, page, handler, limits)) {
    accept();
  }

  SharedState make_shared_state(const ServerOptions& options, std::span<const EmbeddedFile> page,
                                MessageHandler& handler, const Limits& limits) {
    const auto names = host_names(options, acceptor.local_endpoint());
    const std::string token = random_token();
    address = fmt::format("http://{}/?token={}", names.front(), token);
    return SharedState{RequestGuard(token, port, names), page, handler, limits};
  }

  void accept() {
    acceptor.async_accept([this](error_code error, auto socket) {
      if (error == asio::error::operation_aborted) return;
      if (error) return accept_later();
      accept();  // first, since starting a session may throw
      start_session(std::move(socket));
    });
  }

  // The system may have run out of file descriptors: retrying at once would only spin.
  void accept_later() {
    retry.expires_after(std::chrono::milliseconds(100));
    retry.async_wait([this](error_code error) {
      if (!error) accept();
    });
  }

  template <class Socket>
  void start_session(Socket socket) {
    auto& sessions = shared.sessions;
    std::erase_if(sessions, [](const auto& s) { return s.expired(); });
    if (sessions.size() >= connections) close_unauthenticated();
    if (sessions.size() >= connections + spare_connections) return;
    error_code ignored;
    socket.set_option(tcp::no_delay(true), ignored);
    close_on_exec(socket.native_handle());
    const bool full = sessions.size() >= connections;
    sessions.push_back(start_http_session(Stream(std::move(socket)), shared, full));
  }

  // Clients without the token must not block those that have it: closes the oldest without the token.
  void close_unauthenticated() {
    auto& sessions = shared.sessions;
    const auto unauthenticated = std::ranges::find_if(sessions, [](const auto& s) {
      const auto alive = s.lock();
      return alive && !alive->is_authenticated();
    });
    if (unauthenticated == sessions.end()) return;
    unauthenticated->lock()->end();
    sessions.erase(unauthenticated);
  }

  void run() {
    for (;;) {
      try {
        io.run();
        return;
      } catch (...) {  // only the session that threw has ended
      }
    }
  }

  void end() {
    error_code ignored;
    acceptor.close(ignored);
    retry.cancel();
    for (const auto& session : shared.sessions) {
      if (const auto alive = session.lock()) alive->end();
    }
    io.stop();
  }

  // Declared first, so that it is destroyed last.
  asio::io_context io{1};
  Acceptor acceptor;
  Timer retry;
  size_t connections;
  int port;
  std::string address;
  SharedState shared;
  std::thread thread;
};

Server::Server(const ServerOptions& options, std::span<const EmbeddedFile> page, MessageHandler& handler,
               const Limits& limits)
    : state_(std::make_unique<State>(options, page, handler, limits)) {
  // Signals should interrupt the main thread and not this one.
  sigset_t all;
  sigset_t before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  state_->thread = std::thread([state = state_.get()] { state->run(); });
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

Server::~Server() {
  asio::post(state_->io, [state = state_.get()] { state->end(); });
  state_->thread.join();
}

const std::string& Server::address() const { return state_->address; }
int Server::port() const { return state_->port; }

}  // namespace traceflow::serve
