#pragma once

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "base/options.h"

// Reflection for options structs: a list of fields with path, help, and functions to read and write each.
// Flags, --set, TOML, JSON and the page of all options work on this list and need no struct.
namespace traceflow {

enum class OptionKind { boolean, integer, number, text, three_numbers, choice };

// A field's value outside its struct. A choice is represented by its name.
using OptionValue = std::variant<bool, int64_t, double, std::string, std::vector<double>>;

// One field of an options struct; the struct must outlive it.
struct OptionField {
  std::string path;  // dotted, snake_case: "loss.normal"
  std::string unit;  // may be empty
  std::string help;
  OptionKind kind = OptionKind::text;
  std::vector<std::string> choices;  // for a choice
  std::function<OptionValue()> get;
  // Returns false and changes nothing if the field's type cannot hold the value.
  std::function<bool(const OptionValue&)> set;

  // The part after the last dot.
  std::string name() const;
  // The values that the field accepts, in words: "a whole number".
  std::string expected() const;
  // The help, followed by the names of the choices if it does not mention them.
  std::string full_help() const;
};

// Fields of `options` in the order of its visit(). Every path is prefixed with `prefix`.
template <class Options>
std::vector<OptionField> option_fields(Options& options, const std::string& prefix = "");

// The command that lists the options of a training. Callers with other options name their own command.
constexpr std::string_view training_options_page = "traceflow --help-options";

// The field with this path ('-' counts as '_'). If there is none, throws an InputError that begins with
// `where`, suggests the nearest path, and names the command that lists all of them.
const OptionField& find_option(const std::vector<OptionField>& fields, const std::string& path,
                               const std::string& where, std::string_view listed_by = training_options_page);

// Writes one field, from a value or from text in the command line's syntax ("0.5", "true", "1,0,0", "hit").
// Throws InputError beginning with `where` and naming the path, what was found and what the field accepts.
void set_option(const OptionField& field, const OptionValue& value, const std::string& where);
void set_option_text(const OptionField& field, const std::string& text, const std::string& where);

// Writes the field named by "path=value".
void set_option_assignment(const std::vector<OptionField>& fields, const std::string& assignment,
                           const std::string& where, std::string_view listed_by = training_options_page);

// The value in the command line's syntax.
std::string option_text(const OptionValue& value);

namespace detail {

template <class T>
concept ThreeNumbers = requires(T v) {
  v.x;
  v.y;
  v.z;
  requires !requires { v.w; };
};

// The double with the float's shortest decimal text, so that 0.001F is shown and saved as 0.001; it reads
// back as the same float.
double shortest_double(float value);

template <class T>
bool number_from_value(const OptionValue& value, T& target) {
  double wide = 0;
  if (const auto* number = std::get_if<double>(&value)) {
    wide = *number;
  } else if (const auto* integer = std::get_if<int64_t>(&value)) {
    wide = static_cast<double>(*integer);
  } else {
    return false;
  }
  if (!(std::fabs(wide) <= std::numeric_limits<T>::max())) return false;
  target = static_cast<T>(wide);
  return true;
}

template <class T>
OptionValue number_value(T value) {
  if constexpr (std::is_same_v<T, float>) {
    return shortest_double(value);
  } else {
    return value;
  }
}

// Turns a reference to a field into an OptionField, and a group into those of its fields.
class FieldCollector {
 public:
  FieldCollector(std::string prefix, std::vector<OptionField>& fields)
      : prefix_(std::move(prefix)), fields_(fields) {}

  template <class T>
  void field(const char* name, T& value, const char* unit, const char* help) {
    OptionField f;
    f.path = prefix_ + name;
    f.unit = unit;
    f.help = help;
    describe(f, value);
    fields_.push_back(std::move(f));
  }

  template <class Group>
  void group(const char* name, Group& nested) {
    FieldCollector inner(prefix_ + name + ".", fields_);
    nested.visit(inner);
  }

 private:
  static void describe(OptionField& f, bool& value) {
    f.kind = OptionKind::boolean;
    f.get = [&value] { return OptionValue(value); };
    f.set = [&value](const OptionValue& v) {
      const auto* boolean = std::get_if<bool>(&v);
      if (boolean != nullptr) value = *boolean;
      return boolean != nullptr;
    };
  }

  static void describe(OptionField& f, std::string& value) {
    f.kind = OptionKind::text;
    f.get = [&value] { return OptionValue(value); };
    f.set = [&value](const OptionValue& v) {
      const auto* text = std::get_if<std::string>(&v);
      if (text != nullptr) value = *text;
      return text != nullptr;
    };
  }

  template <class T>
  requires std::is_integral_v<T>
  static void describe(OptionField& f, T& value) {
    f.kind = OptionKind::integer;
    f.get = [&value] { return OptionValue(static_cast<int64_t>(value)); };
    f.set = [&value](const OptionValue& v) {
      const auto* integer = std::get_if<int64_t>(&v);
      if (integer == nullptr || !std::in_range<T>(*integer)) return false;
      value = static_cast<T>(*integer);
      return true;
    };
  }

  template <class T>
  requires std::is_floating_point_v<T>
  static void describe(OptionField& f, T& value) {
    f.kind = OptionKind::number;
    f.get = [&value] { return OptionValue(number_value(value)); };
    f.set = [&value](const OptionValue& v) { return number_from_value(v, value); };
  }

  template <ThreeNumbers T>
  static void describe(OptionField& f, T& value) {
    f.kind = OptionKind::three_numbers;
    f.get = [&value] {
      std::vector<double> list;
      for (const auto c : {value.x, value.y, value.z}) list.push_back(std::get<double>(number_value(c)));
      return OptionValue(list);
    };
    f.set = [&value](const OptionValue& v) {
      const auto* list = std::get_if<std::vector<double>>(&v);
      T read = value;
      if (list == nullptr || list->size() != 3 || !number_from_value((*list)[0], read.x) ||
          !number_from_value((*list)[1], read.y) || !number_from_value((*list)[2], read.z)) {
        return false;
      }
      value = read;
      return true;
    };
  }

  template <class E>
  requires std::is_enum_v<E>
  static void describe(OptionField& f, E& value) {
    const auto names = enum_names(E{});
    f.kind = OptionKind::choice;
    f.choices.assign(names.begin(), names.end());
    f.get = [&value, names] { return OptionValue(std::string(names.at(static_cast<size_t>(value)))); };
    f.set = [&value, names](const OptionValue& v) {
      const auto* name = std::get_if<std::string>(&v);
      for (size_t i = 0; name != nullptr && i < names.size(); ++i) {
        if (*name == names[i]) {
          value = static_cast<E>(i);
          return true;
        }
      }
      return false;
    };
  }

  std::string prefix_;
  std::vector<OptionField>& fields_;
};

}  // namespace detail

template <class Options>
std::vector<OptionField> option_fields(Options& options, const std::string& prefix) {
  std::vector<OptionField> fields;
  detail::FieldCollector collector(prefix, fields);
  options.visit(collector);
  return fields;
}

}  // namespace traceflow
