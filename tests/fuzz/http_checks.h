#pragma once

#include <string>
#include <string_view>

#include "fuzz/promise.h"
#include "serve/net/answer.h"

// What the fuzzers of the viewer's server share.
namespace traceflow::fuzz {

inline constexpr std::string_view token = "0123456789abcdef0123456789abcdef";
inline constexpr unsigned char html[] = {'<', 'p', '>'};
inline constexpr unsigned char script[] = {'1', ';'};
inline constexpr EmbeddedFile page[] = {{"index.html", html}, {"viewer.js", script}};

inline serve::RequestGuard request_guard() {
  return {std::string(token), 8080, {"127.0.0.1:8080", "localhost:8080"}};
}

inline size_t count(std::string_view text, std::string_view part) {
  size_t found = 0;
  for (size_t at = 0; (at = text.find(part, at)) != std::string_view::npos; at += part.size()) ++found;
  return found;
}

// Of an answer, from its first line to the empty one; asked: all that was sent for it and before.
inline void check_head(std::string_view head, std::string_view asked) {
  promise(head.starts_with("HTTP/1.1 ") && head.size() > 12, "an answer is HTTP");
  for (const serve::Field& field : serve::safety_fields()) {
    const std::string line = "\r\n" + std::string(field.name) + ": " + std::string(field.value) + "\r\n";
    promise(count(head, line) == 1, "an answer has each safety field once");
  }
  promise(head.find("Access-Control") == std::string_view::npos, "no answer is for other sites");
  const std::string_view status = head.substr(9, 3);
  const bool knows = asked.find(token) != std::string_view::npos;
  if (status == "200" || status == "101" || status == "404" || status == "426") {
    promise(knows, "nothing is given to who does not know the token");
    promise(asked.find(":8080") != std::string_view::npos, "nothing is given under another name");
  }
  promise(knows || head.find(token) == std::string_view::npos, "the token is told to nobody");
  if (status == "101") {
    promise(asked.find("http://") != std::string_view::npos, "a live connection is for our own page");
  }
}

}  // namespace traceflow::fuzz
