#pragma once

#include <stdexcept>
#include <string>

namespace traceflow {

// Input that cannot be used: a file, an option, a capture. The program prints what() as its one line and
// exits 2. One line that can be shown, whatever stands in the parts.
class InputError : public std::runtime_error {
 public:
  // where: the file or option; field: the place inside it, may be empty; found, expected: values in words;
  // remedy: what the user can do, may be empty.
  InputError(const std::string& where, const std::string& field, const std::string& found,
             const std::string& expected, const std::string& remedy = "");
};

// A broken promise inside the program, with the values that were observed.
class InternalError : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

// Throws InternalError with the condition's text and the given values when an invariant does not hold.
void require(bool condition, const char* invariant, const std::string& observed = "");

}  // namespace traceflow
