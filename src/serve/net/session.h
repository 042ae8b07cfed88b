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
#include "serve/net/gate.h"
#include "serve/net/limits.h"
#include "serve/net/room.h"

// Boost's headers are many: this one is for the files that carry connections alone.
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

// A connection. Lives for as long as it waits for something.
class Session {
 public:
  virtual ~Session() = default;
  // Cuts the connection, so that nothing is waited for any more.
  virtual void end() = 0;
  // Whether whoever is at the other end has shown the token.
  virtual bool known() const = 0;
};

// What all connections of a server share. Outlives them.
struct Common {
  Gate gate;
  std::span<const EmbeddedFile> page;
  Room& room;
  Limits limits;
  uint64_t guests = 0;  // that ever were
  std::vector<std::weak_ptr<Session>> sessions = {};
};

// Ends a session when the time that it was given is over, however much happened in between.
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

// After the last words of a connection: what the other side still sends is read for a moment, as closing the
// connection at once would take those words from it.
template <class Session>
class Farewell {
 public:
  void begin(Session& session, Stream& stream) {
    boost::system::error_code ignored;
    stream.shutdown(Stream::shutdown_send, ignored);
    read(session, stream);
  }

 private:
  void read(Session& session, Stream& stream) {
    stream.async_read_some(
        boost::asio::buffer(unheard_),
        [this, &stream, self = session.shared_from_this()](const boost::system::error_code& error, size_t) {
          if (error) return self->end();
          read(*self, stream);
        });
  }

  std::array<char, 4096> unheard_{};
};

}  // namespace traceflow::serve
