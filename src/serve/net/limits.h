#pragma once

#include <chrono>
#include <cstddef>

namespace traceflow::serve {

// What one connection may use. The viewer's page stays far below; a connection that exceeds a limit is
// closed.
struct Limits {
  size_t header_bytes = 8 << 10;    // of a request
  size_t message_bytes = 64 << 10;  // that a page sends
  size_t waiting_bytes = 64 << 20;  // on their way to a page
  size_t waiting_messages = 1024;   // likewise
  // From the connection or the last answer until the whole request has arrived; also until an answer is sent.
  std::chrono::milliseconds request{20'000};
  // To send 256 KiB of a message.
  std::chrono::milliseconds piece{20'000};
  // Until a silent connection is closed; a ping is sent at half of it.
  std::chrono::milliseconds silence{60'000};
  // To read what the client still sends after the last answer.
  std::chrono::milliseconds linger{2'000};
};

}  // namespace traceflow::serve
