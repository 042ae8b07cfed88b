#include "cli/arguments/option_toml.h"

#include <fmt/format.h>

#include <optional>
#include <sstream>

#include "base/error.h"
#include "base/utf8.h"
#include "files/input_file.h"

// For a table named "[:]" the parser asserts a condition that it checks and reports in the next line. The
// assertion would end a debug build; with NDEBUG it becomes an assumption for clang.
#undef NDEBUG
#define TOML_ASSERT(expression) static_assert(true)
#include <toml++/toml.h>

namespace traceflow::cli {

namespace {

constexpr int64_t most_bytes = int64_t{1} << 20;
constexpr int deepest = 64;

// Runs before the parser. Limits nesting, since the parser recurses into tables. Escapes characters beyond
// ASCII, since the parser's error recovery fails on them.
class Guard {
 public:
  explicit Guard(const std::filesystem::path& path) : path_(path.string()) {}

  // The same settings in ASCII, line by line.
  std::string in_ascii(std::string_view text) {
    if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
    std::string result;
    while (!text.empty()) {
      if (text.starts_with("\"\"\"") || text.starts_with("'''"))
        fail("three quotes", "strings that end in their line");
      const auto character = first_utf8_character(text);
      if (!character) fail("bytes that are not UTF-8", "text in UTF-8");
      if (character->bytes == 1) take(text[0]);
      result += character->bytes == 1 ? std::string(1, text[0]) : escape(character->code);
      text.remove_prefix(character->bytes);
    }
    return result;
  }

 private:
  void take(char c) {
    if (c == '\n') {
      ++line_;
      dots_ = 0;
      quote_ = '\0';
      follows_backslash_ = false;
    } else if (follows_backslash_) {
      follows_backslash_ = false;
    } else if (quote_ == '"' && c == '\\') {
      follows_backslash_ = true;
    } else if (quote_ != '\0') {
      quote_ = c == quote_ ? '\0' : quote_;
    } else if (c == '"' || c == '\'' || c == '#') {
      quote_ = c == '#' ? '\n' : c;
    } else {
      brackets_ += c == '[' || c == '{' ? 1 : c == ']' || c == '}' ? -1 : 0;
      dots_ += c == '.' ? 1 : 0;
      if (brackets_ > deepest) fail(fmt::format("more than {} open brackets", deepest), "options");
      if (dots_ > deepest) fail(fmt::format("more than {} dots", deepest), "options");
    }
  }
  std::string escape(char32_t code) const {
    if (quote_ == '\n') return "?";
    if (quote_ != '"' || follows_backslash_) fail("a letter beyond ASCII", "such letters in double quotes");
    return fmt::format("\\U{:08X}", static_cast<uint32_t>(code));
  }
  [[noreturn]] void fail(const std::string& found, const std::string& expected) const {
    throw InputError(fmt::format("{}:{}", path_, line_), "", found, expected);
  }

  std::string path_;
  int line_ = 1, brackets_ = 0, dots_ = 0;
  char quote_ = '\0';  // what ends the present string or, if '\n', the present comment
  bool follows_backslash_ = false;
};

std::string read_settings(const std::filesystem::path& path) {
  const InputFile file(path);
  if (file.size() > most_bytes) {
    throw InputError(path.string(), "", fmt::format("{} bytes", file.size()),
                     fmt::format("a TOML file of options, of at most {}", most_bytes));
  }
  std::string text(static_cast<size_t>(file.size()), '\0');
  file.read_at(0, std::as_writable_bytes(std::span(text)));
  return Guard(path).in_ascii(text);
}

// The kind of the node in one word.
std::string kind_of(const toml::node& node) {
  std::ostringstream text;
  text << node.type();
  return "a value of type " + text.str();
}

std::string place(const std::filesystem::path& path, const toml::source_region& source) {
  return path.string() + ":" + std::to_string(source.begin.line);
}

std::optional<OptionValue> option_value(const toml::node& node) {
  if (const auto* boolean = node.as_boolean()) return boolean->get();
  if (const auto* integer = node.as_integer()) return integer->get();
  if (const auto* number = node.as_floating_point()) return number->get();
  if (const auto* text = node.as_string()) return text->get();
  const auto* array = node.as_array();
  if (array == nullptr) return std::nullopt;
  std::vector<double> list;
  for (const toml::node& element : *array) {
    const auto number = element.value<double>();
    if (!number) return std::nullopt;
    list.push_back(*number);
  }
  return list;
}

void read_table(const toml::table& table, const std::string& prefix, const std::filesystem::path& path,
                const std::vector<OptionField>& fields, std::string_view listed_by) {
  for (const auto& [key, node] : table) {
    const std::string name = prefix + std::string(key.str());
    if (const auto* nested = node.as_table()) {
      read_table(*nested, name + ".", path, fields, listed_by);
      continue;
    }
    const std::string where = place(path, node.source());
    const OptionField& field = find_option(fields, name, where, listed_by);
    const auto value = option_value(node);
    if (!value) throw InputError(where, name, kind_of(node), field.expected());
    set_option(field, *value, where);
  }
}

}  // namespace

void options_from_toml(const std::filesystem::path& path, const std::vector<OptionField>& fields,
                       std::string_view listed_by) {
  const std::string text = read_settings(path);
  try {
    read_table(toml::parse(text, path.string()), "", path, fields, listed_by);
  } catch (const toml::parse_error& e) {
    throw InputError(place(path, e.source()), "", std::string(e.description()), "TOML");
  }
}

}  // namespace traceflow::cli
