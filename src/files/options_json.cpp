#include "files/options_json.h"

#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "files/json_document.h"

namespace traceflow {

namespace {

using OrderedJson = nlohmann::ordered_json;

// Far more than options have. Reading them in order takes time quadratic in their number.
constexpr int deepest_option = 16;
constexpr size_t most_values = 10'000;

OrderedJson json_value(const OptionValue& value) {
  return std::visit([](const auto& v) { return OrderedJson(v); }, value);
}

OrderedJson& member(OrderedJson& root, const std::string& path) {
  OrderedJson* node = &root;
  size_t begin = 0;
  for (size_t dot = path.find('.'); dot != std::string::npos; dot = path.find('.', begin)) {
    node = &(*node)[path.substr(begin, dot - begin)];
    if (node->is_null()) *node = OrderedJson::object();
    begin = dot + 1;
  }
  return (*node)[path.substr(begin)];
}

std::optional<OptionValue> option_value(const OrderedJson& json) {
  if (json.is_boolean()) return json.get<bool>();
  if (json.is_number_unsigned() && json.get<uint64_t>() > static_cast<uint64_t>(INT64_MAX))
    return std::nullopt;
  if (json.is_number_integer()) return json.get<int64_t>();
  if (json.is_number()) return json.get<double>();
  if (json.is_string()) return json.get<std::string>();
  if (!json.is_array()) return std::nullopt;
  std::vector<double> list;
  for (const OrderedJson& element : json) {
    if (!element.is_number()) return std::nullopt;
    list.push_back(element.get<double>());
  }
  return list;
}

void read_object(const OrderedJson& object, const std::string& prefix, const std::vector<OptionField>& fields,
                 const std::string& where) {
  for (const auto& [key, node] : object.items()) {
    const std::string path = prefix + key;
    if (node.is_object()) {
      read_object(node, path + ".", fields, where);
      continue;
    }
    const OptionField& field = find_option(fields, path, where);
    const auto value = option_value(node);
    if (!value) {
      throw InputError(where, path, node.dump(-1, ' ', false, OrderedJson::error_handler_t::replace),
                       field.expected());
    }
    set_option(field, *value, where);
  }
}

OrderedJson parse(const std::string& text, const std::string& where) {
  const JsonExtent extent = json_extent(text);
  if (extent.depth > deepest_option)
    throw InputError(where, "", "JSON nested too deep", "an object of options");
  if (extent.values > most_values)
    throw InputError(where, "", std::to_string(extent.values) + " values", "an object of options");
  try {
    return OrderedJson::parse(text);
  } catch (const OrderedJson::exception&) {
    throw InputError(where, "", "text that is not JSON", "an object of options");
  }
}

}  // namespace

std::string options_to_json(const std::vector<OptionField>& fields) {
  OrderedJson root = OrderedJson::object();
  for (const OptionField& field : fields) member(root, field.path) = json_value(field.get());
  return root.dump(-1, ' ', false, OrderedJson::error_handler_t::replace);
}

void options_from_json(const std::string& text, const std::vector<OptionField>& fields,
                       const std::string& where) {
  const OrderedJson root = parse(text, where);
  if (!root.is_object()) throw InputError(where, "", "JSON that is no object", "an object of options");
  read_object(root, "", fields, where);
}

}  // namespace traceflow
