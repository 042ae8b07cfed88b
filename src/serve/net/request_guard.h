#pragma once

#include <optional>
#include <string>
#include <vector>

#include "serve/net/request.h"

namespace traceflow::serve {

struct Refusal {
  int status;
  std::string words;
};

// Decides which requests are answered (docs/view.md, Safety). Any web page can make a browser send requests
// to this machine (cross-site request forgery), and any host name can be made to resolve to it (DNS
// rebinding). So a request must name this server (Host), come from its own page or from the user (Origin,
// Sec-Fetch-Site), and carry the token of the printed address.
class RequestGuard {
 public:
  // hosts: accepted values of Host, "name:port".
  RequestGuard(std::string token, int port, std::vector<std::string> hosts);

  // Why a request is refused; nothing if it is allowed.
  std::optional<Refusal> refusal(const Request& request) const;

  // Whether a request for the page has the token in its address, so that the answer should set the cookie.
  bool brings_token(const Request& request) const;
  // The value of Set-Cookie.
  std::string cookie() const;

 private:
  bool is_host(std::string_view text) const;
  bool has_cookie(const Request& request) const;
  std::optional<Refusal> wrong_host(const Request& request) const;
  std::optional<Refusal> foreign_page(const Request& request) const;

  std::string token_;
  std::string cookie_name_;
  int port_;
  std::vector<std::string> hosts_;
};

}  // namespace traceflow::serve
