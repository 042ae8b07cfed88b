#include "serve/net/request_guard.h"

#include <fmt/format.h>

#include <algorithm>

#include "serve/net/token.h"

namespace traceflow::serve {

namespace {

// Whether another site's page sent the request, except when the user follows a link to the page. Browsers
// treat other ports of this machine as the same site, so only the same origin is accepted.
bool is_cross_site(const Request& request) {
  const auto sites = request.all("Sec-Fetch-Site");
  const bool foreign = std::ranges::any_of(sites, [](std::string_view site) {
    return !same_word(site, "same-origin") && !same_word(site, "none");
  });
  if (!foreign) return false;
  const auto is = [&](std::string_view name, std::string_view value) {
    const auto values = request.all(name);
    return values.size() == 1 && same_word(values[0], value);
  };
  const bool visit = is("Sec-Fetch-Mode", "navigate") && is("Sec-Fetch-Dest", "document");
  return !(visit && request.path() == "/");
}

bool has_body(const Request& request) {
  if (!request.all("Transfer-Encoding").empty()) return true;
  const auto lengths = request.all("Content-Length");
  return std::ranges::any_of(lengths, [](std::string_view length) { return length != "0"; });
}

}  // namespace

RequestGuard::RequestGuard(std::string token, int port, std::vector<std::string> hosts)
    : token_(std::move(token)),
      cookie_name_(fmt::format("traceflow_{}", port)),
      port_(port),
      hosts_(std::move(hosts)) {}

std::optional<Refusal> RequestGuard::refusal(const Request& request) const {
  if (!request.target.starts_with('/')) return Refusal{400, "The request names no path."};
  if (auto refusal = wrong_host(request)) return refusal;
  if (auto refusal = foreign_page(request)) return refusal;
  if (request.method != "GET" && request.method != "HEAD") {
    return Refusal{405, "Only GET and HEAD are answered here."};
  }
  if (has_body(request)) return Refusal{413, "No request here has a body."};
  if (!brings_token(request) && !has_cookie(request)) {
    return Refusal{403, "Open the whole address that the terminal printed, ?token=… included."};
  }
  return std::nullopt;
}

bool RequestGuard::brings_token(const Request& request) const {
  return request.path() == "/" && !request.upgrade && same_secret(request.query("token"), token_);
}

std::string RequestGuard::cookie() const {
  return fmt::format("{}={}; HttpOnly; SameSite=Strict; Path=/", cookie_name_, token_);
}

bool RequestGuard::is_host(std::string_view text) const {
  return std::ranges::any_of(hosts_, [&](const auto& host) { return same_word(host, text); });
}

// One valid cookie is enough: a server on another port of this machine can set a cookie of the same name.
bool RequestGuard::has_cookie(const Request& request) const {
  bool found = false;
  for (std::string_view rest : request.all("Cookie")) {
    while (!rest.empty()) {
      const std::string_view pair = trimmed(rest.substr(0, rest.find(';')));
      rest.remove_prefix(std::min(rest.size(), rest.find(';')));
      if (!rest.empty()) rest.remove_prefix(1);
      const size_t equals = std::min(pair.size(), pair.find('='));
      if (pair.substr(0, equals) != cookie_name_ || equals == pair.size()) continue;
      found = same_secret(pair.substr(equals + 1), token_) || found;
    }
  }
  return found;
}

std::optional<Refusal> RequestGuard::wrong_host(const Request& request) const {
  const auto hosts = request.all("Host");
  if (hosts.size() != 1) return Refusal{400, "A request names exactly one host."};
  if (is_host(hosts[0])) return std::nullopt;
  return Refusal{
      421, fmt::format("The viewer does not answer under this name.\n\n"
                       "Over ssh, forward the same port, and open the address that the terminal printed:\n"
                       "    ssh -L {0}:127.0.0.1:{0} MACHINE\n\n"
                       "Or start the viewer with --allow-host NAME:PORT, as the browser's address has them.",
                       port_)};
}

std::optional<Refusal> RequestGuard::foreign_page(const Request& request) const {
  const auto origins = request.all("Origin");
  constexpr std::string_view scheme = "http://";
  const bool ours =
      origins.size() == 1 && origins[0].starts_with(scheme) && is_host(origins[0].substr(scheme.size()));
  const bool unsaid = origins.empty() && !request.upgrade;
  if ((ours || unsaid) && !is_cross_site(request)) return std::nullopt;
  return Refusal{403, "Only the viewer's own page may ask for this."};
}

}  // namespace traceflow::serve
