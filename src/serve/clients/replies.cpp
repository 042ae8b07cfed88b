#include "serve/clients/replies.h"

#include <nlohmann/json.hpp>

namespace traceflow::serve {

namespace {

using Json = nlohmann::ordered_json;

std::string dump(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

}  // namespace

Outgoing text_message(std::string text) {
  return {std::make_shared<const std::string>(std::move(text)), false};
}

Outgoing json_message(const Json& json) { return text_message(dump(json)); }

Outgoing picture_message(const Json& header, const std::string& picture) {
  const std::string text = dump(header);
  const auto length = static_cast<uint32_t>(text.size());
  std::string bytes;
  bytes.reserve(4 + text.size() + picture.size());
  for (int byte = 0; byte < 4; ++byte) bytes += static_cast<char>((length >> (8 * byte)) & 255);
  bytes += text;
  bytes += picture;
  return {std::make_shared<const std::string>(std::move(bytes)), true};
}

Outgoing refusal(const std::string& request, int64_t id, const std::string& why) {
  return json_message({{"type", "refused"}, {"request", request}, {"id", id}, {"text", why}});
}

}  // namespace traceflow::serve
