#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

#include "serve/net/room.h"

namespace traceflow::serve {

// Messages to pages, as web/src/messages.ts has them.
Outgoing text_message(std::string text);
Outgoing json_message(const nlohmann::ordered_json& json);
// A picture with its header: length of the header (32 bit, little endian), header, picture.
Outgoing picture_message(const nlohmann::ordered_json& header, const std::string& picture);
// That a request of this type and number is not answered, and why, in words.
Outgoing refusal(const std::string& request, int64_t id, const std::string& why);

}  // namespace traceflow::serve
