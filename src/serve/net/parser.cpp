#include "serve/net/parser.h"

#include <boost/beast/websocket/rfc6455.hpp>
#include <limits>

namespace traceflow::serve {

namespace {

std::string_view view(boost::beast::string_view text) { return {text.data(), text.size()}; }

}  // namespace

void set_limits(Parser& parser, const Limits& limits) {
  parser.header_limit(static_cast<uint32_t>(limits.header_bytes));
  // The parser would treat "none" as less than any length.
  parser.body_limit(std::numeric_limits<uint64_t>::max());
}

Request request_of(const ParsedRequest& parsed) {
  Request request;
  request.method = view(parsed.method_string());
  request.target = view(parsed.target());
  for (const auto& field : parsed) request.fields.push_back({view(field.name_string()), view(field.value())});
  request.upgrade = boost::beast::websocket::is_upgrade(parsed);
  request.stays = parsed.keep_alive();
  return request;
}

}  // namespace traceflow::serve
