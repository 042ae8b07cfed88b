#include "base/option_fields.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <optional>

namespace traceflow {

namespace {

std::string last_part(const std::string& path) { return path.substr(path.rfind('.') + 1); }

std::string with_underscores(std::string text) {
  std::replace(text.begin(), text.end(), '-', '_');
  return text;
}

// Names of choices use hyphens.
std::string with_hyphens(std::string text) {
  std::replace(text.begin(), text.end(), '_', '-');
  return text;
}

// The Levenshtein distance: insertions, deletions and replacements that turn a into b.
size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<size_t> row(b.size() + 1);
  for (size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (size_t i = 1; i <= a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
    }
  }
  return row[b.size()];
}

// The path that the user may have meant, or an empty one: the nearest whole path, or the one with this name
// if the groups were left out.
std::string nearest_path(const std::vector<OptionField>& fields, const std::string& path) {
  std::string best;
  size_t best_distance = std::max<size_t>(2, path.size() / 3) + 1;
  for (const OptionField& field : fields) {
    size_t distance = edit_distance(path, field.path);
    if (path.find('.') == std::string::npos) distance = std::min(distance, edit_distance(path, field.name()));
    if (distance < best_distance) {
      best_distance = distance;
      best = field.path;
    }
  }
  return best;
}

template <class T>
std::optional<T> parse_number(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::optional<OptionValue> parse_list(std::string_view text) {
  std::vector<double> list;
  while (true) {
    const size_t comma = text.find(',');
    const auto number = parse_number<double>(text.substr(0, comma));
    if (!number) return std::nullopt;
    list.push_back(*number);
    if (comma == std::string_view::npos) return list;
    text.remove_prefix(comma + 1);
  }
}

// Text as a value of the field's kind; nullopt if it cannot be parsed.
std::optional<OptionValue> parse(const OptionField& field, const std::string& text) {
  switch (field.kind) {
    case OptionKind::boolean:
      if (text == "true" || text == "on" || text == "1") return true;
      if (text == "false" || text == "off" || text == "0") return false;
      return std::nullopt;
    case OptionKind::integer:
      return parse_number<int64_t>(text);
    case OptionKind::number:
      return parse_number<double>(text);
    case OptionKind::three_numbers:
      return parse_list(text);
    case OptionKind::text:
      return text;
    case OptionKind::choice:
      return with_hyphens(text);
  }
  return std::nullopt;
}

[[noreturn]] void refuse(const OptionField& field, const std::string& found, const std::string& where) {
  throw InputError(where, field.path, found.empty() ? "nothing" : found, field.expected());
}

}  // namespace

std::string number_text(double value) { return fmt::format("{}", value); }
std::string number_text(float value) { return fmt::format("{}", value); }
std::string number_text(int64_t value) { return fmt::format("{}", value); }

double detail::shortest_double(float value) {
  const auto read = parse_number<double>(number_text(value));
  return read && static_cast<float>(*read) == value ? *read : static_cast<double>(value);
}

std::string OptionField::name() const { return last_part(path); }

std::string OptionField::expected() const {
  switch (kind) {
    case OptionKind::boolean:
      return "true or false";
    case OptionKind::integer:
      return "a whole number";
    case OptionKind::number:
      return "a number";
    case OptionKind::text:
      return "text";
    case OptionKind::three_numbers:
      return "three numbers such as 0,0.5,1";
    case OptionKind::choice:
      return fmt::format("{}", fmt::join(choices, choices.size() > 2 ? ", " : " or "));
  }
  return "";
}

std::string OptionField::full_help() const {
  const bool says_all = std::all_of(choices.begin(), choices.end(), [this](const std::string& choice) {
    return help.find(choice) != std::string::npos;
  });
  return says_all ? help : help + " One of " + expected() + ".";
}

const OptionField& find_option(const std::vector<OptionField>& fields, const std::string& path,
                               const std::string& where, std::string_view listed_by) {
  const std::string wanted = with_underscores(path);
  for (const OptionField& field : fields) {
    if (field.path == wanted) return field;
  }
  for (const OptionField& field : fields) {
    if (field.path.starts_with(wanted + ".")) {
      throw InputError(where, path, "a group of options", "one option, such as " + field.path);
    }
  }
  const std::string nearest = nearest_path(fields, wanted);
  throw InputError(where, path, "no option of this name", fmt::format("one that `{}` lists", listed_by),
                   nearest.empty() ? "" : "did you mean " + nearest + "?");
}

void set_option(const OptionField& field, const OptionValue& value, const std::string& where) {
  if (!field.set(value)) refuse(field, option_text(value), where);
}

void set_option_text(const OptionField& field, const std::string& text, const std::string& where) {
  const auto value = parse(field, text);
  if (!value || !field.set(*value)) refuse(field, text, where);
}

void set_option_assignment(const std::vector<OptionField>& fields, const std::string& assignment,
                           const std::string& where, std::string_view listed_by) {
  const size_t equals = assignment.find('=');
  if (equals == std::string::npos) throw InputError(where, "", assignment, "an assignment, PATH=VALUE");
  set_option_text(find_option(fields, assignment.substr(0, equals), where, listed_by),
                  assignment.substr(equals + 1), where);
}

std::string option_text(const OptionValue& value) {
  struct Writer {
    std::string operator()(bool v) const { return v ? "true" : "false"; }
    std::string operator()(int64_t v) const { return number_text(v); }
    std::string operator()(double v) const { return number_text(v); }
    std::string operator()(const std::string& v) const { return v; }
    std::string operator()(const std::vector<double>& v) const {
      return fmt::format("{}", fmt::join(v, ","));
    }
  };
  return std::visit(Writer{}, value);
}

}  // namespace traceflow
