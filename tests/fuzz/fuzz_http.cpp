// Bytes as a request: parser, guard, answer, without a connection.
#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <cstdint>

#include "fuzz/http_checks.h"
#include "serve/net/parser.h"

using namespace traceflow;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  // No more than a connection's buffer holds.
  const std::string_view asked(reinterpret_cast<const char*>(data),
                               std::min(size, serve::Limits().header_bytes));
  serve::Parser parser;
  serve::set_limits(parser, {});
  boost::system::error_code error;
  parser.put(boost::asio::buffer(asked), error);
  if (!parser.is_header_done()) return 0;
  static const serve::RequestGuard guard = fuzz::request_guard();
  const serve::Request request = serve::request_of(parser.get());
  const serve::Answer reply = serve::answer(guard, fuzz::page, request);
  const std::string text = serve::wire_text(reply, {true, request.stays});
  fuzz::check_head(std::string_view(text).substr(0, text.find("\r\n\r\n") + 2), asked);
  fuzz::promise(text.substr(text.find("\r\n\r\n") + 4) == reply.body, "the body follows the empty line");
  const bool of_the_page = std::any_of(std::begin(fuzz::page), std::end(fuzz::page),
                                       [&](const EmbeddedFile& file) { return file.text() == reply.body; });
  fuzz::promise(reply.status != 200 || of_the_page, "what is given is the page's");
  fuzz::promise(reply.status != 200 || request.method == "GET" || request.method == "HEAD",
                "only reading is done");
  return 0;
}
