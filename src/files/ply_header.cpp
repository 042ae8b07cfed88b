#include "files/ply_header.h"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <optional>
#include <set>
#include <sstream>
#include <string_view>

#include "base/error.h"

namespace traceflow {

namespace {

constexpr int64_t header_cap = 65536;
constexpr int64_t property_cap = 512;
std::optional<PlyScalar> scalar_named(const std::string& name) {
  static const std::map<std::string, PlyScalar> names = {
      {"char", PlyScalar::i8},    {"int8", PlyScalar::i8},     {"uchar", PlyScalar::u8},
      {"uint8", PlyScalar::u8},   {"short", PlyScalar::i16},   {"int16", PlyScalar::i16},
      {"ushort", PlyScalar::u16}, {"uint16", PlyScalar::u16},  {"int", PlyScalar::i32},
      {"int32", PlyScalar::i32},  {"uint", PlyScalar::u32},    {"uint32", PlyScalar::u32},
      {"float", PlyScalar::f32},  {"float32", PlyScalar::f32}, {"double", PlyScalar::f64},
      {"float64", PlyScalar::f64}};
  const auto found = names.find(name);
  if (found == names.end()) return std::nullopt;
  return found->second;
}

int64_t bytes_of(PlyScalar type) {
  constexpr std::array<int64_t, 8> sizes = {1, 1, 2, 2, 4, 4, 4, 8};
  return sizes[static_cast<size_t>(type)];
}

// Text for a message, cut so that it fits in one line.
std::string one_line(std::string_view text) {
  std::string clean;
  for (const char c : text.substr(0, 60)) clean += c >= 32 && c < 127 ? c : '?';
  return "\"" + clean + (text.size() > 60 ? "…\"" : "\"");
}

// The header's text, up to and including the end_header line.
std::string read_header_text(const InputFile& file) {
  std::string text(static_cast<size_t>(std::min(file.size(), header_cap)), '\0');
  file.read_at(0, std::as_writable_bytes(std::span(text.data(), text.size())));
  if (!text.starts_with("ply\n") && !text.starts_with("ply\r\n")) {
    throw InputError(file.path().string(), "first line", one_line(text.substr(0, text.find('\n'))), "\"ply\"",
                     ply_remedy);
  }
  for (size_t line = 0; line < text.size();) {
    const size_t end = text.find('\n', line);
    if (end == std::string::npos) break;
    const std::string_view words = std::string_view(text).substr(line, end - line);
    if (words == "end_header" || words == "end_header\r") return text.substr(0, end + 1);
    line = end + 1;
  }
  throw InputError(file.path().string(), "header", "no end_header line",
                   fmt::format("one within the first {} bytes", header_cap), ply_remedy);
}

// Parses the header line by line; an unknown line is an error.
class HeaderParser {
 public:
  explicit HeaderParser(const InputFile& file) : path_(file.path().string()) {
    const std::string text = read_header_text(file);
    header_.bytes = static_cast<int64_t>(text.size());
    std::istringstream lines(text);
    std::string line;
    std::getline(lines, line);
    while (std::getline(lines, line)) {
      line.erase(line.find_last_not_of('\r') + 1);
      take(line);
    }
    if (!format_seen_) fail("format", "none", "binary_little_endian 1.0");
    if (elements_ == 0) fail("header", "no element", "element vertex");
    const int64_t body = file.size() - header_.bytes;
    int64_t wanted = 0;
    if (__builtin_mul_overflow(header_.rows, header_.row_bytes, &wanted) || wanted > body) {
      fail(
          "element vertex",
          fmt::format("{} vertices of {} bytes in a body of {} bytes", header_.rows, header_.row_bytes, body),
          "as many bytes as the header promises");
    }
  }
  PlyHeader result() { return std::move(header_); }

 private:
  [[noreturn]] void fail(const std::string& field, const std::string& found,
                         const std::string& expected) const {
    throw InputError(path_, field, found, expected, ply_remedy);
  }

  void take(const std::string& line) {
    std::istringstream words(line);
    std::string keyword;
    words >> keyword;
    if (keyword == "format") {
      take_format(line);
    } else if (keyword == "comment") {
      take_comment(words);
    } else if (keyword == "element") {
      take_element(words, line);
    } else if (keyword == "property") {
      if (elements_ == 0) fail("header", one_line(line), "an element before its properties");
      if (elements_ == 1) take_property(words, line);
    } else if (keyword != "obj_info" && keyword != "end_header") {
      fail("header", one_line(line), "a line of a PLY header");
    }
  }

  void take_format(const std::string& line) {
    if (line != "format binary_little_endian 1.0") fail("format", one_line(line), "binary_little_endian 1.0");
    format_seen_ = true;
  }

  void take_comment(std::istringstream& words) {
    std::string owner, key, value;
    if (!(words >> owner >> key) || owner != "traceflow") return;
    std::getline(words >> std::ws, value);
    header_.notes[key] = value;
  }

  void take_element(std::istringstream& words, const std::string& line) {
    std::string name, count;
    words >> name >> count;
    elements_ += 1;
    if (elements_ > 1) return;
    const auto [end, error] = std::from_chars(count.data(), count.data() + count.size(), header_.rows);
    if (name != "vertex" || error != std::errc() || end != count.data() + count.size() || header_.rows < 0) {
      fail("first element", one_line(line), "element vertex COUNT");
    }
    if (header_.rows > INT32_MAX) fail("element vertex", count, "at most 2147483647");
  }

  void take_property(std::istringstream& words, const std::string& line) {
    std::string type, name;
    words >> type >> name;
    const std::optional<PlyScalar> scalar = scalar_named(type);
    if (!scalar || name.empty()) fail("property", one_line(line), "a scalar type and a name");
    if (!names_.insert(name).second) fail("property " + one_line(name), "two of it", "one");
    if (names_.size() > property_cap) fail("property", "more than 512", "the attributes of 2DGS");
    header_.properties.push_back({name, *scalar, header_.row_bytes});
    header_.row_bytes += bytes_of(*scalar);
  }

  std::string path_;
  PlyHeader header_;
  std::set<std::string> names_;
  int elements_ = 0;
  bool format_seen_ = false;
};

}  // namespace

const PlyProperty* PlyHeader::find(const std::string& name) const {
  for (const PlyProperty& p : properties) {
    if (p.name == name) return &p;
  }
  return nullptr;
}

PlyHeader read_ply_header(const InputFile& file) { return HeaderParser(file).result(); }

}  // namespace traceflow
