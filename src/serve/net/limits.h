#pragma once

#include <chrono>
#include <cstddef>

namespace traceflow::serve {

// Limits of one connection. The viewer's page stays far below them; a connection that exceeds one is closed.
struct Limits {
  size_t header_bytes = 8 << 10;    // of a request
  size_t message_bytes = 64 << 10;  // sent by a page
  size_t waiting_bytes = 64 << 20;  // queued for a page
  size_t waiting_messages = 1024;   // queued for a page
  // From the connection or the last answer until the whole request has arrived; also for sending an answer.
  std::chrono::milliseconds request{20'000};
  // For sending 256 KiB of a message.
  std::chrono::milliseconds piece{20'000};
  // Until a silent connection is closed; a ping is sent after half of it.
  std::chrono::milliseconds silence{60'000};
  // For reading what the client still sends after the last answer.
  std::chrono::milliseconds linger{2'000};
};

}  // namespace traceflow::serve
