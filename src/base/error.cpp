#include "base/error.h"

namespace traceflow {

namespace {

std::string message(const std::string& where, const std::string& field, const std::string& found,
                    const std::string& expected, const std::string& remedy) {
  std::string text = where;
  if (!field.empty()) text += ": " + field;
  if (!found.empty()) text += ": found " + found;
  if (!expected.empty()) text += ", expected " + expected;
  if (!remedy.empty()) text += "; " + remedy;
  return text;
}

}  // namespace

InputError::InputError(const std::string& where, const std::string& field, const std::string& found,
                       const std::string& expected, const std::string& remedy)
    : std::runtime_error(message(where, field, found, expected, remedy)) {}

void require(bool condition, const char* invariant, const std::string& observed) {
  if (condition) return;
  throw InternalError(std::string("invariant broken: ") + invariant +
                      (observed.empty() ? "" : " (" + observed + ")"));
}

}  // namespace traceflow
