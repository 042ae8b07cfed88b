#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

#include "serve/net/message_handler.h"

namespace traceflow::serve {

// Messages to pages, as in web/src/messages.ts.
Outgoing text_message(std::string text);
Outgoing json_message(const nlohmann::ordered_json& json);
// A picture message: length of its header (32 bit, little endian), header, picture.
Outgoing picture_message(const nlohmann::ordered_json& header, const std::string& picture);
// Refuses the request of this type and number; `why` is shown to the user.
Outgoing refusal(const std::string& request, int64_t id, const std::string& why);

}  // namespace traceflow::serve
