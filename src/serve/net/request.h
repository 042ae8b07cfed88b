#pragma once

#include <string_view>
#include <vector>

namespace traceflow::serve {

struct Field {
  std::string_view name;
  std::string_view value;
};

// The parts of a request on which the answer depends. Bodies are not accepted.
struct Request {
  std::string_view method;
  std::string_view target;  // as sent, from the first / to the end of the query
  std::vector<Field> fields;
  bool upgrade = false;  // requests a WebSocket
  bool stays = false;    // keep-alive

  // The values of all fields with this name, ignoring case.
  std::vector<std::string_view> all(std::string_view name) const;
  std::string_view path() const { return target.substr(0, target.find('?')); }
  // The first value of this name in the query; empty if there is none.
  std::string_view query(std::string_view name) const;
};

std::string_view trimmed(std::string_view text);
// Compares without regard to the case of ASCII letters.
bool same_word(std::string_view a, std::string_view b);

}  // namespace traceflow::serve
