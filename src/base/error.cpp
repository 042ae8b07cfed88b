#include "base/error.h"

#include "base/printable.h"

namespace traceflow {

namespace {

// Longest text of a value in a message; paths are never cut.
constexpr size_t longest_words = 300;
constexpr size_t longest_path = 8192;

std::string message(const std::string& where, const std::string& field, const std::string& found,
                    const std::string& expected, const std::string& remedy) {
  std::string text = printable(where, longest_path);
  if (!field.empty()) text += ": " + printable(field, longest_words);
  if (!found.empty()) text += ": found " + printable(found, longest_words);
  if (!expected.empty()) text += ", expected " + printable(expected, longest_words);
  if (!remedy.empty()) text += "; " + printable(remedy, longest_path);
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
