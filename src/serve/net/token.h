#pragma once

#include <string>
#include <string_view>

namespace traceflow::serve {

// 128 bits of the system's randomness, as 32 hex digits. Throws InternalError where the system gives none.
std::string random_token();

// Whether two secrets are equal, in a time that depends on their lengths alone.
bool same_secret(std::string_view a, std::string_view b);

}  // namespace traceflow::serve
