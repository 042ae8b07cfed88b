#pragma once

#include <cstdint>
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
// and `void validate() const`, which throws InputError through check_option. Everything else (flags, --set,
// TOML, the checkpoint, the viewer) is a visitor (base/option_fields.h), so that each option is named once. A
// dotted path names a field from outside: `loss.normal`. Names use snake_case. Supported types: bool, int,
// int64_t, float, double, std::string, Vec3 of a float, and enums whose values count from 0 and whose names
// are given by a function found by ADL:
//
//   enum class SortOrder { centre, hit };
//   constexpr std::array<std::string_view, 2> enum_names(SortOrder) { return {"centre", "hit"}; }
namespace traceflow {

// The shortest decimal text that reads back as the same value.
std::string number_text(double value);
std::string number_text(float value);
std::string number_text(int64_t value);

// Throws InputError "option NAME: found …, expected …" unless the condition holds.
template <class T>
void check_option(bool condition, const std::string& name, const T& found, const std::string& expected) {
  if (condition) return;
  if constexpr (std::is_convertible_v<T, std::string>) {
    throw InputError("option", name, found, expected);
  } else if constexpr (std::is_floating_point_v<T>) {
    throw InputError("option", name, number_text(found), expected);
  } else {
    throw InputError("option", name, number_text(static_cast<int64_t>(found)), expected);
  }
}

inline void check_share(float value, const char* name) {
  check_option(value >= 0 && value <= 1, name, value, "0 to 1");
}
inline void check_not_negative(double value, const char* name) {
  check_option(value >= 0, name, value, "0 or more");
}

}  // namespace traceflow
