#include "cli/arguments/option_toml.h"

#include <toml++/toml.h>
#include <fstream>
#include <optional>
#include <sstream>

#include "base/error.h"

namespace traceflow::cli {

namespace {

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
                const std::vector<OptionField>& fields) {
  for (const auto& [key, node] : table) {
    const std::string name = prefix + std::string(key.str());
    if (const auto* nested = node.as_table()) {
      read_table(*nested, name + ".", path, fields);
      continue;
    }
    const std::string where = place(path, node.source());
    const OptionField& field = find_option(fields, name, where);
    const auto value = option_value(node);
    if (!value) throw InputError(where, name, "a value of another type", field.expected());
    set_option(field, *value, where);
  }
}

}  // namespace

void options_from_toml(const std::filesystem::path& path, const std::vector<OptionField>& fields) {
  std::error_code error;
  std::ifstream file(path, std::ios::binary);
  if (!std::filesystem::is_regular_file(path, error) || !file) {
    throw InputError(path.string(), "", "no file that can be read", "a TOML file of options");
  }
  std::ostringstream text;
  text << file.rdbuf();
  try {
    read_table(toml::parse(text.str(), path.string()), "", path, fields);
  } catch (const toml::parse_error& e) {
    throw InputError(place(path, e.source()), std::string(e.description()), "", "");
  }
}

}  // namespace traceflow::cli
