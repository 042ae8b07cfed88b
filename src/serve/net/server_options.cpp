#include <arpa/inet.h>

#include <algorithm>
#include <array>

#include "serve/net/server.h"

namespace traceflow::serve {

namespace {

bool is_address(const std::string& text) {
  std::array<unsigned char, 16> bytes{};
  return inet_pton(AF_INET, text.c_str(), bytes.data()) == 1 ||
         inet_pton(AF_INET6, text.c_str(), bytes.data()) == 1;
}

bool is_port(std::string_view text) {
  const bool digits = std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; });
  if (!digits || text.empty() || text.size() > 5 || text[0] == '0') return false;
  return std::stoi(std::string(text)) <= 65535;
}

// Whether the text is a host as a browser writes it in Host: a name, an IPv4 address, or an IPv6 address in
// brackets, and a port.
bool is_host(std::string_view text) {
  const size_t colon = text.rfind(':');
  if (colon == std::string_view::npos || colon == 0 || !is_port(text.substr(colon + 1))) return false;
  const std::string_view name = text.substr(0, colon);
  if (name.front() == '[')
    return name.back() == ']' && is_address(std::string(name.substr(1, name.size() - 2)));
  return std::ranges::all_of(name, [](unsigned char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
           c == '-' || c == '_';
  });
}

}  // namespace

void ServerOptions::validate() const {
  check_option(is_address(bind), "bind", bind, "an address of this machine, such as 127.0.0.1 or 0.0.0.0");
  check_option(port >= 0 && port <= 65535, "port", port, "0 to 65535");
  check_option(connections >= 1 && connections <= 1024, "connections", connections, "1 to 1024");
  for (const std::string& host : allowed_hosts) {
    check_option(is_host(host), "allow_host", host, "NAME:PORT, as the browser's address has them");
  }
}

}  // namespace traceflow::serve
