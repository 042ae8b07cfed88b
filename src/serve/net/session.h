#pragma once

#include <array>
#include <boost/asio/basic_stream_socket.hpp>
#include <boost/asio/generic/stream_protocol.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <memory>
#include <span>
#include <vector>

#include "base/embedded_file.h"
#include "serve/net/limits.h"
#include "serve/net/message_handler.h"
#include "serve/net/request_guard.h"

// Includes much of Boost, so only the files that implement connections include this header.
namespace traceflow::serve {

// Everything here runs on the one thread of an io_context.
using Executor = boost::asio::io_context::executor_type;

// Any byte stream: TCP, or a substitute for it. A separate class, so that async_teardown() of
// websocket_session.cpp is found.
class Stream : public boost::asio::basic_stream_socket<boost::asio::generic::stream_protocol, Executor> {
 public:
  using basic_stream_socket::basic_stream_socket;
};
using Timer =
    boost::asio::basic_waitable_timer<std::chrono::steady_clock,
                                      boost::asio::wait_traits<std::chrono::steady_clock>, Executor>;

// One connection. Its pending operations keep it alive.
class Session {
 public:
  virtual ~Session() = default;
  // Closes the connection and so cancels its pending operations.
  virtual void end() = 0;
  // Whether the client has sent the token.
  virtual bool is_authenticated() const = 0;
};

// State shared by all connections of a server. Must outlive them.
struct SharedState {
  RequestGuard guard;
  std::span<const EmbeddedFile> page;
  MessageHandler& handler;
  Limits limits;
  uint64_t clients = 0;  // number of clients so far
  std::vector<std::weak_ptr<Session>> sessions = {};
};

// Ends a session when its time is over, whatever has happened in between.
class Deadline {
 public:
  explicit Deadline(const Executor& executor) : timer_(executor) {}

  // Starts now and replaces the previous deadline.
  void set(std::chrono::milliseconds time, std::weak_ptr<Session> session) {
    timer_.expires_after(time);
    timer_.async_wait([this, watched = std::move(session)](const boost::system::error_code& error) {
      if (error) return;
      const auto alive = watched.lock();
      // A deadline that expired just as the next one was set does not count.
      if (alive && timer_.expiry() <= std::chrono::steady_clock::now()) alive->end();
    });
  }
  void clear() { timer_.expires_at(std::chrono::steady_clock::time_point::max()); }

 private:
  Timer timer_;
};

// Closes a connection after its last answer. Reads for a moment what the client still sends: closing at once
// would reset the connection, and the client might lose the answer (RFC 9112, section 9.6).
template <class Session>
class LingeringClose {
 public:
  void begin(Session& session, Stream& stream) {
    boost::system::error_code ignored;
    stream.shutdown(Stream::shutdown_send, ignored);
    read(session, stream);
  }

 private:
  void read(Session& session, Stream& stream) {
    stream.async_read_some(
        boost::asio::buffer(discarded_),
        [this, &stream, self = session.shared_from_this()](const boost::system::error_code& error, size_t) {
          if (error) return self->end();
          read(*self, stream);
        });
  }

  std::array<char, 4096> discarded_{};
};

}  // namespace traceflow::serve
