#pragma once

#include <string_view>
#include <vector>

namespace traceflow::serve {

struct Field {
  std::string_view name;
  std::string_view value;
};

// What of a request is decided on: all of it, as there is no body.
struct Request {
  std::string_view method;
  std::string_view target;  // as sent, from the first / to the end of the query
  std::vector<Field> fields;
  bool upgrade = false;  // asks for a WebSocket
  bool stays = false;    // the connection is to be used again

  // The values of the fields of a name, whatever its case.
  std::vector<std::string_view> all(std::string_view name) const;
  std::string_view path() const { return target.substr(0, target.find('?')); }
  // The first value of a name in the query; empty where there is none.
  std::string_view query(std::string_view name) const;
};

std::string_view trimmed(std::string_view text);
// Whatever the case of ASCII letters.
bool same_word(std::string_view a, std::string_view b);

}  // namespace traceflow::serve
