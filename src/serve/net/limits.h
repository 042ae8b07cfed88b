#pragma once

#include <chrono>
#include <cstddef>

namespace traceflow::serve {

// How much of anything a connection may take. No page comes near these; who does is cut off.
struct Limits {
  size_t header_bytes = 8 << 10;    // of a request
  size_t message_bytes = 64 << 10;  // that a page sends
  size_t waiting_bytes = 64 << 20;  // on their way to a page
  size_t waiting_messages = 1024;   // likewise
  // Until a whole request is there, from the connection or the last answer on; until an answer is taken.
  std::chrono::milliseconds request{20'000};
  // Until 256 KiB of a message are taken.
  std::chrono::milliseconds piece{20'000};
  // Until a page that says nothing is given up; at half of it, it is asked for a sign of life.
  std::chrono::milliseconds silence{60'000};
  // To end a connection in good manners.
  std::chrono::milliseconds linger{2'000};
};

}  // namespace traceflow::serve
