#include "serve/net/token.h"

#include <fmt/format.h>
#include <sys/random.h>

#include <array>

#include "base/error.h"

namespace traceflow::serve {

std::string random_token() {
  std::array<unsigned char, 16> bytes{};
  // getrandom returns up to 256 bytes completely or fails.
  const ssize_t got = getrandom(bytes.data(), bytes.size(), 0);
  require(got == static_cast<ssize_t>(bytes.size()), "the system gives random bytes", std::to_string(got));
  return fmt::format("{:02x}", fmt::join(bytes, ""));
}

bool same_secret(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  volatile unsigned char differing = 0;  // volatile: the compiler cannot add an early exit
  for (size_t i = 0; i < a.size(); ++i) differing = differing | static_cast<unsigned char>(a[i] ^ b[i]);
  return differing == 0;
}

}  // namespace traceflow::serve
