#pragma once

#include <stdexcept>
#include <string>

namespace traceflow {

// Unusable input: a file, an option or a capture. The program prints what() and exits with 2. what() is a
// single printable line, whatever its parts contain.
class InputError : public std::runtime_error {
 public:
  // where: the file or option; field: the place inside it, may be empty; found, expected: the values in
  // words; remedy: what the user can do, may be empty.
  InputError(const std::string& where, const std::string& field, const std::string& found,
             const std::string& expected, const std::string& remedy = "");
};

// A violated invariant of the program, with the observed values.
class InternalError : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

// Throws InternalError with the invariant's text and the observed values unless the condition holds.
void require(bool condition, const char* invariant, const std::string& observed = "");

}  // namespace traceflow
