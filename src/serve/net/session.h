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

// Any stream of bytes: TCP, or what stands in for it. A class of its own, so that async_teardown() of
// socket.cpp is found.
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
  // Whether the client has shown the token.
  virtual bool is_authenticated() const = 0;
};

// What all connections of a server share. Outlives them.
struct SharedState {
  RequestGuard guard;
  std::span<const EmbeddedFile> page;
  MessageHandler& handler;
  Limits limits;
  uint64_t clients = 0;  // that ever were
  std::vector<std::weak_ptr<Session>> sessions = {};
};

// Ends a session when its time is over, whatever happened in between.
class Deadline {
 public:
  explicit Deadline(const Executor& executor) : timer_(executor) {}

  // From now; takes the place of the last one.
  void set(std::chrono::milliseconds time, std::weak_ptr<Session> session) {
    timer_.expires_after(time);
    timer_.async_wait([this, watched = std::move(session)](const boost::system::error_code& error) {
      if (error) return;
      const auto alive = watched.lock();
      // A deadline that was reached just when the next one was set does not count.
      if (alive && timer_.expiry() <= std::chrono::steady_clock::now()) alive->end();
    });
  }
  void clear() { timer_.expires_at(std::chrono::steady_clock::time_point::max()); }

 private:
  Timer timer_;
};

// Closes a connection after its last answer. Reads what the client still sends for a moment, since closing at
// once would reset the connection and the client might lose the answer (RFC 9112, section 9.6).
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
