#include "serve/net/answer.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace traceflow::serve {

namespace {

constexpr std::string_view content_security_policy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src "
    "'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

constexpr std::array<Field, 6> safety = {{{"Content-Security-Policy", content_security_policy},
                                          {"X-Content-Type-Options", "nosniff"},
                                          {"Referrer-Policy", "no-referrer"},
                                          {"Cross-Origin-Resource-Policy", "same-origin"},
                                          {"Cross-Origin-Opener-Policy", "same-origin"},
                                          {"Cache-Control", "no-store"}}};

std::string_view content_type(std::string_view name) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 6> types = {{
      {".html", "text/html; charset=utf-8"},
      {".js", "text/javascript; charset=utf-8"},
      {".css", "text/css; charset=utf-8"},
      {".svg", "image/svg+xml"},
      {".png", "image/png"},
      {".json", "application/json"},
  }};
  for (const auto& [ending, type] : types) {
    if (name.ends_with(ending)) return type;
  }
  return "application/octet-stream";
}

std::string_view reason(int status) {
  switch (status) {
    case 101:
      return "Switching Protocols";
    case 200:
      return "OK";
    case 400:
      return "Bad Request";
    case 403:
      return "Forbidden";
    case 404:
      return "Not Found";
    case 405:
      return "Method Not Allowed";
    case 413:
      return "Content Too Large";
    case 421:
      return "Misdirected Request";
    case 426:
      return "Upgrade Required";
    case 431:
      return "Request Header Fields Too Large";
    case 503:
      return "Service Unavailable";
    default:
      return "Error";
  }
}

}  // namespace

Answer answer(const RequestGuard& guard, std::span<const EmbeddedFile> page, const Request& request) {
  if (const auto refusal = guard.refusal(request)) return plain_answer(refusal->status, refusal->words);
  const std::string_view path = request.path();
  if (path == "/ws") {
    if (request.upgrade) return {101, {}, {}, {}};
    return plain_answer(426, "This address is for the page's live connection.");
  }
  // Looks up the name in the embedded page only: no folder is ever read.
  const std::string_view name = path == "/" ? "index.html" : path.substr(1);
  const auto file = std::ranges::find(page, name, &EmbeddedFile::name);
  if (file == page.end() || request.upgrade) return plain_answer(404, "There is nothing at this address.");
  Answer found{200, std::string(content_type(name)), std::string(file->text()), {}};
  if (guard.brings_token(request)) found.fields.emplace_back("Set-Cookie", guard.cookie());
  return found;
}

Answer plain_answer(int status, std::string text) {
  Answer answer{status, "text/plain; charset=utf-8", std::move(text) + "\n", {}};
  if (status == 405) answer.fields.emplace_back("Allow", "GET, HEAD");
  if (status == 426) answer.fields.emplace_back("Upgrade", "websocket");
  return answer;
}

std::span<const Field> safety_fields() { return safety; }

std::string wire_text(const Answer& answer, const Form& form) {
  std::string text =
      fmt::format("HTTP/1.1 {} {}\r\nServer: traceflow\r\n", answer.status, reason(answer.status));
  for (const Field& field : safety) text += fmt::format("{}: {}\r\n", field.name, field.value);
  for (const auto& [name, value] : answer.fields) text += fmt::format("{}: {}\r\n", name, value);
  text += fmt::format("Content-Type: {}\r\nContent-Length: {}\r\n", answer.type, answer.body.size());
  text += form.stays ? "Connection: keep-alive\r\n\r\n" : "Connection: close\r\n\r\n";
  if (form.body) text += answer.body;
  return text;
}

}  // namespace traceflow::serve
