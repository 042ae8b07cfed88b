#pragma once

#include <string>
#include <string_view>

namespace traceflow::serve {

// 128 random bits from the system, as 32 hex digits. Throws InternalError if the system provides none.
std::string random_token();

// Compares two secrets in a time that depends only on their lengths.
bool same_secret(std::string_view a, std::string_view b);

}  // namespace traceflow::serve
