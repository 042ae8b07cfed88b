#pragma once

#include <string>
#include <type_traits>

#include "base/error.h"

// Options are plain structs. Each has one member
//
//   template <class Visitor> void visit(Visitor& v) {
//     v.field("threshold", threshold, "unit", "One line of help.");
//     v.group("loss", loss);                       // a nested options struct
//   }
//
// and `void validate() const`, which throws InputError through check_option. Everything else (flags, --set, TOML, the
// checkpoint, the viewer) is a visitor of these, so an option is named once. A dotted path names a field from outside:
// `loss.normal`. Names use snake_case; supported types: bool, int, int64_t, float, double, std::string, and enums that
// have `enum_names(E)` (see below).
namespace traceflow {

// Throws InputError "option NAME: found …, expected …" unless the condition holds.
template <class T>
void check_option(bool condition, const std::string& name, const T& found, const std::string& expected) {
  if (condition) return;
  if constexpr (std::is_convertible_v<T, std::string>) {
    throw InputError("option", name, found, expected);
  } else {
    throw InputError("option", name, std::to_string(found), expected);
  }
}

}  // namespace traceflow
