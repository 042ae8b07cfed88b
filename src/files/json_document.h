#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "files/input_file.h"
#include "math/types.h"

namespace traceflow {

// A value in a JSON document with its path, for error messages. Every reader throws InputError with the
// document, the field, what was found and what was expected.
class JsonField {
 public:
  // Whether there is such a member; null counts as none.
  bool has(const std::string& key) const;
  // A required member.
  JsonField operator[](const std::string& key) const;
  // The raw value. Callers that use it include nlohmann/json.hpp.
  const nlohmann::json& json() const { return *value_; }

  // A finite number.
  double number() const;
  double number(double low, double high) const;
  double positive() const;
  int64_t whole(int64_t low, int64_t high) const;
  bool yes() const;
  // A string of at most `longest` bytes.
  std::string text(size_t longest = 4096) const;
  // `count` finite numbers.
  std::vector<double> numbers(size_t count) const;
  // Three numbers within ±1e15, so that single precision can hold them after some arithmetic.
  Vec3<double> vector() const;
  // The rotation nearest to the 3×3 matrix given as rows; files carry few digits.
  Mat3<double> rotation() const;
  // A list of strings; whole numbers are accepted and become their digits.
  std::vector<std::string> strings() const;
  // The elements of an array: at most a million, or exactly `count`.
  std::vector<JsonField> elements() const;
  std::vector<JsonField> elements(size_t count) const;

  [[noreturn]] void fail(const std::string& found, const std::string& expected,
                         const std::string& remedy = "") const;
  // The same, with the beginning of this value as what was found.
  [[noreturn]] void expect(const std::string& expected) const;

 protected:
  JsonField(std::string document, std::string name, const nlohmann::json* value)
      : document_(std::move(document)), name_(std::move(name)), value_(value) {}
  void point_to(const nlohmann::json* value) { value_ = value; }

 private:
  JsonField element(size_t i) const;

  std::string document_;
  std::string name_;
  const nlohmann::json* value_;
};

// Bounds on the content of a JSON text, known before it is parsed.
struct JsonExtent {
  int depth = 0;      // of nested arrays and objects
  size_t values = 0;  // upper bound
};
JsonExtent json_extent(std::string_view text);
// A parsed value takes up to 160 bytes.
constexpr size_t max_json_values = 4'000'000;

// A whole document; its fields are valid as long as it exists. Throws InputError for text that is not JSON,
// for more than max_json_values, and for arrays and objects nested deeper than 64, since the code that
// traverses them is recursive.
class JsonDocument : public JsonField {
 public:
  // name: the document's name in errors.
  JsonDocument(std::string name, std::string_view text);
  ~JsonDocument();
  JsonDocument(const JsonDocument&) = delete;
  JsonDocument& operator=(const JsonDocument&) = delete;

 private:
  std::unique_ptr<const nlohmann::json> root_;
};

// The text of a file of at most 64 MiB.
std::string read_text(const InputFile& file);
std::string read_text(const std::filesystem::path& path);

class JsonFile : public JsonDocument {
 public:
  explicit JsonFile(const InputFile& file);
  explicit JsonFile(const std::filesystem::path& path) : JsonFile(InputFile(path)) {}
};

}  // namespace traceflow
