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
  std::chrono::milliseconds request{
      20'000};  // from the connection, or the last answer, to a whole request; to an answer's end
  std::chrono::milliseconds piece{20'000};    // to take 256 KiB of a message
  std::chrono::milliseconds silence{60'000};  // of a page that is asked for a sign of life at half of this
  std::chrono::milliseconds linger{
      1'000};  // that what a refused client still sends is read, so that it sees why
};

}  // namespace traceflow::serve
