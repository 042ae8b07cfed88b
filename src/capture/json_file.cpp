#include "capture/json_file.h"

#include <cmath>

#include "base/error.h"
#include "files/input_file.h"

namespace traceflow {

namespace {

constexpr int64_t max_bytes = int64_t{256} << 20;

std::string text_of(const std::filesystem::path& path) {
  const InputFile file(path);
  if (file.size() > max_bytes) {
    throw InputError(path.string(), "", std::to_string(file.size()) + " bytes",
                     "a JSON file of at most 256 MiB");
  }
  std::string text(static_cast<size_t>(file.size()), '\0');
  file.read_at(0, std::as_writable_bytes(std::span(text)));
  return text;
}

}  // namespace

JsonFile::JsonFile(const std::filesystem::path& path) : JsonField(path, "", nullptr) {
  try {
    root_ = nlohmann::json::parse(text_of(path));
  } catch (const nlohmann::json::parse_error& error) {
    throw InputError(path.string(), "byte " + std::to_string(error.byte), "broken JSON", "valid JSON");
  }
  point_to(&root_);
  if (!root_.is_object()) fail(root_.type_name(), "an object");
}

bool JsonField::has(const std::string& key) const {
  return value_->is_object() && value_->contains(key) && !value_->at(key).is_null();
}

JsonField JsonField::operator[](const std::string& key) const {
  JsonField field(path_, name_.empty() ? key : name_ + "." + key, has(key) ? &value_->at(key) : nullptr);
  if (field.value_ == nullptr) field.fail("nothing", "a value");
  return field;
}

JsonField JsonField::element(size_t i) const {
  return {path_, name_ + "[" + std::to_string(i) + "]", &value_->at(i)};
}

double JsonField::number() const {
  if (!value_->is_number() || !std::isfinite(value_->get<double>())) fail(found(), "a finite number");
  return value_->get<double>();
}

double JsonField::positive() const {
  const double value = number();
  if (!(value > 0)) fail(found(), "a number above zero");
  return value;
}

std::vector<double> JsonField::numbers(size_t count) const {
  std::vector<double> result;
  for (const JsonField& field : elements(count)) result.push_back(field.number());
  return result;
}

std::vector<std::string> JsonField::strings() const {
  if (!value_->is_array()) fail(found(), "a list of strings");
  std::vector<std::string> result;
  for (size_t i = 0; i < value_->size(); ++i) {
    const nlohmann::json& value = value_->at(i);
    if (value.is_string()) {
      result.push_back(value.get<std::string>());
    } else if (value.is_number_integer()) {
      result.push_back(value.dump());
    } else {
      element(i).fail(element(i).found(), "a string");
    }
  }
  return result;
}

std::vector<JsonField> JsonField::elements(size_t count) const {
  if (!value_->is_array() || value_->size() != count) fail(found(), "a list of " + std::to_string(count));
  std::vector<JsonField> result;
  for (size_t i = 0; i < count; ++i) result.push_back(element(i));
  return result;
}

void JsonField::fail(const std::string& found, const std::string& expected, const std::string& remedy) const {
  throw InputError(path_.string(), name_, found, expected, remedy);
}

std::string JsonField::found() const {
  constexpr size_t longest = 60;
  std::string text = value_->dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  if (text.size() > longest) text = text.substr(0, longest) + "…";
  return text;
}

}  // namespace traceflow
