#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/embedded_file.h"
#include "serve/net/request_guard.h"

namespace traceflow::serve {

struct Answer {
  int status = 200;  // 101: the connection becomes a WebSocket
  std::string type;  // of the body
  std::string body;
  std::vector<std::pair<std::string, std::string>> fields;  // in addition to those that every answer has
};

// The answer to a request.
Answer answer(const RequestGuard& guard, std::span<const EmbeddedFile> page, const Request& request);

// An answer that is one line of plain text.
Answer plain_answer(int status, std::string text);

// The security headers that every answer has.
std::span<const Field> safety_fields();

struct Form {
  bool body = true;    // false: the answer to HEAD
  bool stays = false;  // keep-alive
};

// The answer's bytes in HTTP/1.1.
std::string wire_text(const Answer& answer, const Form& form);

}  // namespace traceflow::serve
