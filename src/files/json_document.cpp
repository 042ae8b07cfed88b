#include "files/json_document.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"

namespace traceflow {

namespace {

constexpr int64_t max_bytes = int64_t{64} << 20;
constexpr int max_depth = 64;
// A JsonField takes a hundred times the two bytes that a list element may have.
constexpr size_t max_elements = 1'000'000;

nlohmann::json parse(const std::string& name, std::string_view text) {
  const JsonExtent extent = json_extent(text);
  if (extent.depth > max_depth) {
    throw InputError(name, "", fmt::format("brackets more than {} deep", max_depth), "JSON of common depth");
  }
  if (extent.values > max_json_values) {
    throw InputError(name, "", fmt::format("{} values", extent.values),
                     fmt::format("at most {}", max_json_values));
  }
  try {
    return nlohmann::json::parse(text);
  } catch (const nlohmann::json::parse_error& error) {
    throw InputError(name, fmt::format("byte {}", error.byte), "text that is not JSON", "JSON");
  } catch (const nlohmann::json::out_of_range&) {
    throw InputError(name, "", "a number beyond double precision", "numbers up to 1.8e308");
  }
}

}  // namespace

JsonExtent json_extent(std::string_view text) {
  JsonExtent extent{0, 1};
  int depth = 0;
  bool in_string = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string && c == '\\') {
      ++i;
    } else if (c == '"') {
      in_string = !in_string;
    } else if (!in_string) {
      const bool opens = c == '[' || c == '{';
      depth += opens ? 1 : c == ']' || c == '}' ? -1 : 0;
      extent.depth = std::max(extent.depth, depth);
      extent.values += opens || c == ',' ? 1 : 0;
    }
  }
  return extent;
}

std::string read_text(const InputFile& file) {
  if (file.size() > max_bytes) {
    throw InputError(file.path().string(), "", fmt::format("{} bytes", file.size()),
                     "a JSON file of at most 64 MiB");
  }
  std::string text(static_cast<size_t>(file.size()), '\0');
  file.read_at(0, std::as_writable_bytes(std::span(text)));
  return text;
}

std::string read_text(const std::filesystem::path& path) { return read_text(InputFile(path)); }

JsonDocument::JsonDocument(std::string name, std::string_view text)
    : JsonField(name, "", nullptr), root_(std::make_unique<const nlohmann::json>(parse(name, text))) {
  point_to(root_.get());
}

JsonDocument::~JsonDocument() = default;

JsonFile::JsonFile(const InputFile& file) : JsonDocument(file.path().string(), read_text(file)) {}

bool JsonField::has(const std::string& key) const {
  return value_->is_object() && value_->contains(key) && !value_->at(key).is_null();
}

JsonField JsonField::operator[](const std::string& key) const {
  if (!value_->is_object()) expect("an object");
  JsonField field(document_, name_.empty() ? key : name_ + "." + key, has(key) ? &value_->at(key) : nullptr);
  if (field.value_ == nullptr) field.fail("nothing", "a value");
  return field;
}

JsonField JsonField::element(size_t i) const {
  return {document_, fmt::format("{}[{}]", name_, i), &value_->at(i)};
}

double JsonField::number() const {
  if (!value_->is_number() || !std::isfinite(value_->get<double>())) expect("a finite number");
  return value_->get<double>();
}

double JsonField::number(double low, double high) const {
  if (!value_->is_number()) expect("a number");
  const auto value = value_->get<double>();
  if (!(value >= low && value <= high)) expect(fmt::format("{} to {}", low, high));
  return value;
}

double JsonField::positive() const {
  const double value = number();
  if (!(value > 0)) expect("a number above zero");
  return value;
}

int64_t JsonField::whole(int64_t low, int64_t high) const {
  const double value = value_->is_number() ? value_->get<double>() : 0.5;
  if (!(value >= static_cast<double>(low) && value <= static_cast<double>(high)) ||
      value != std::floor(value)) {
    expect(fmt::format("a whole number, {} to {}", low, high));
  }
  return static_cast<int64_t>(value);
}

bool JsonField::yes() const {
  if (!value_->is_boolean()) expect("true or false");
  return value_->get<bool>();
}

std::string JsonField::text(size_t longest) const {
  if (!value_->is_string()) expect("a string");
  const auto& text = value_->get_ref<const std::string&>();
  if (text.size() > longest)
    fail(fmt::format("{} bytes", text.size()), fmt::format("a string of at most {}", longest));
  return text;
}

std::vector<double> JsonField::numbers(size_t count) const {
  std::vector<double> result;
  for (const JsonField& field : elements(count)) result.push_back(field.number());
  return result;
}

Vec3<double> JsonField::vector() const {
  constexpr double far = 1e15;
  const std::vector<JsonField> v = elements(3);
  return {v[0].number(-far, far), v[1].number(-far, far), v[2].number(-far, far)};
}

Mat3<double> JsonField::rotation() const {
  constexpr double tolerance = 1e-2;
  const std::vector<JsonField> rows = elements(3);
  Mat3<double> rotation = transpose(Mat3<double>(rows[0].vector(), rows[1].vector(), rows[2].vector()));
  const Mat3<double> error = transpose(rotation) * rotation - Mat3<double>(1);
  double worst = 0;
  for (int i = 0; i < 9; ++i) worst = std::max(worst, std::abs(error[i / 3][i % 3]));
  if (!(worst <= tolerance)) fail("rows that are not orthonormal", "a rotation, three rows of three numbers");
  if (!(determinant(rotation) > 0)) fail("a mirrored frame", "a rotation");
  for (int step = 0; step < 4 && worst > 1e-12; ++step)
    rotation = 0.5 * (rotation + inverse(transpose(rotation)));
  return rotation;
}

std::vector<std::string> JsonField::strings() const {
  std::vector<std::string> result;
  for (const JsonField& field : elements())
    result.push_back(field.value_->is_number_integer() ? field.value_->dump() : field.text());
  return result;
}

std::vector<JsonField> JsonField::elements() const {
  if (!value_->is_array()) expect("a list");
  if (value_->size() > max_elements)
    fail(fmt::format("{} elements", value_->size()), fmt::format("{} at most", max_elements));
  std::vector<JsonField> result;
  for (size_t i = 0; i < value_->size(); ++i) result.push_back(element(i));
  return result;
}

std::vector<JsonField> JsonField::elements(size_t count) const {
  if (!value_->is_array() || value_->size() != count) expect(fmt::format("a list of {}", count));
  return elements();
}

void JsonField::fail(const std::string& found, const std::string& expected, const std::string& remedy) const {
  throw InputError(document_, name_, found, expected, remedy);
}

void JsonField::expect(const std::string& expected) const {
  constexpr size_t longest = 60;
  std::string text = value_->dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
  if (text.size() > longest) text = text.substr(0, longest) + "…";
  fail(text, expected);
}

}  // namespace traceflow
