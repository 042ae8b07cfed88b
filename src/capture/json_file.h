#pragma once

#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace traceflow {

// A place in a JSON file that knows its name, so that what is wrong there can be said: every reader throws
// InputError with file, field, what was found and what was expected.
class JsonField {
 public:
  bool has(const std::string& key) const;
  // A member that must be there.
  JsonField operator[](const std::string& key) const;

  double number() const;
  double positive() const;
  // `count` finite numbers.
  std::vector<double> numbers(size_t count) const;
  // Strings; whole numbers are taken for their digits.
  std::vector<std::string> strings() const;
  // The elements of an array of `count` elements.
  std::vector<JsonField> elements(size_t count) const;

  [[noreturn]] void fail(const std::string& found, const std::string& expected,
                         const std::string& remedy = "") const;

 protected:
  JsonField(std::filesystem::path path, std::string name, const nlohmann::json* value)
      : path_(std::move(path)), name_(std::move(name)), value_(value) {}
  void point_to(const nlohmann::json* value) { value_ = value; }

 private:
  JsonField element(size_t i) const;
  std::string found() const;

  std::filesystem::path path_;
  std::string name_;
  const nlohmann::json* value_;
};

// The whole file; fields taken from it live as long as it does.
class JsonFile : public JsonField {
 public:
  explicit JsonFile(const std::filesystem::path& path);
  JsonFile(const JsonFile&) = delete;
  JsonFile& operator=(const JsonFile&) = delete;

 private:
  nlohmann::json root_;
};

}  // namespace traceflow
