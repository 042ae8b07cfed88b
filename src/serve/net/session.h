#pragma once

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

// Any stream of bytes: TCP, or what tests put in its place. Bound to the one thread that runs everything
// here.
using Executor = boost::asio::io_context::executor_type;
using Stream = boost::asio::basic_stream_socket<boost::asio::generic::stream_protocol, Executor>;
using Timer =
    boost::asio::basic_waitable_timer<std::chrono::steady_clock,
                                      boost::asio::wait_traits<std::chrono::steady_clock>, Executor>;

// A connection. Lives for as long as it waits for something.
class Session {
 public:
  virtual ~Session() = default;
  // Cuts the connection, so that nothing is waited for any more.
  virtual void end() = 0;
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

}  // namespace traceflow::serve
