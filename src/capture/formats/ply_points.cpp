#include "capture/formats/ply_points.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <span>
#include <string>

#include "base/error.h"
#include "files/limits.h"
#include "files/ply_header.h"

namespace traceflow {

namespace {

constexpr int64_t largest_text = int64_t{1} << 28;

void check_point_count(const InputFile& file, int64_t count) {
  if (count <= max_capture_points) return;
  throw InputError(file.path().string(), "element vertex", std::to_string(count),
                   "at most " + std::to_string(max_capture_points), "keep fewer of them");
}

double load(const PlyProperty& property, const std::byte* row) {
  if (property.type == PlyScalar::f64) {
    double value = 0;
    std::memcpy(&value, row + property.offset, sizeof value);
    return value;
  }
  float value = 0;
  std::memcpy(&value, row + property.offset, sizeof value);
  return value;
}

std::vector<Vec3<double>> read_binary(const InputFile& file) {
  const PlyHeader header = read_ply_header(file);
  check_point_count(file, header.rows);
  std::array<const PlyProperty*, 3> axes{};
  for (size_t i = 0; i < 3; ++i) {
    const std::string name(1, static_cast<char>('x' + i));
    axes[i] = header.find(name);
    if (axes[i] == nullptr || (axes[i]->type != PlyScalar::f32 && axes[i]->type != PlyScalar::f64))
      throw InputError(file.path().string(), "property " + name, "none", "a float or a double");
  }
  constexpr int64_t rows_at_a_time = 4096;
  std::vector<std::byte> buffer(
      static_cast<size_t>(std::min(header.rows, rows_at_a_time) * header.row_bytes));
  std::vector<Vec3<double>> points;
  points.reserve(static_cast<size_t>(header.rows));
  for (int64_t first = 0; first < header.rows; first += rows_at_a_time) {
    const int64_t rows = std::min(rows_at_a_time, header.rows - first);
    file.read_at(header.bytes + first * header.row_bytes,
                 std::span(buffer.data(), static_cast<size_t>(rows * header.row_bytes)));
    for (int64_t r = 0; r < rows; ++r) {
      const std::byte* row = buffer.data() + r * header.row_bytes;
      points.emplace_back(load(*axes[0], row), load(*axes[1], row), load(*axes[2], row));
    }
  }
  return points;
}

// Reads successive words of a text, with line ends.
class Words {
 public:
  explicit Words(std::string_view text) : text_(text) {}
  // Empty at the end of the line.
  std::string_view next() {
    const size_t begin = std::min(text_.find_first_not_of(" \t\r", at_), text_.size());
    const size_t end = std::min(text_.find_first_of(" \t\r\n", begin), text_.size());
    at_ = end;
    return text_.substr(begin, end - begin);
  }
  void end_line() { at_ = std::min(text_.find('\n', at_), text_.size() - 1) + 1; }
  bool at_end() const { return at_ >= text_.size(); }

 private:
  std::string_view text_;
  size_t at_ = 0;
};

class TextReader {
 public:
  TextReader(const InputFile& file, std::string_view text) : file_(file), words_(text) {}

  std::vector<Vec3<double>> read(int64_t bytes) {
    read_header();
    // A row of three numbers takes at least six bytes.
    if (rows_ < 0 || rows_ > bytes / 6) {
      fail("element vertex",
           std::to_string(rows_) + " vertices in a file of " + std::to_string(bytes) + " bytes",
           "as many as the file holds");
    }
    check_point_count(file_, rows_);
    std::vector<Vec3<double>> points;
    points.reserve(static_cast<size_t>(rows_));
    for (int64_t i = 0; i < rows_; ++i) points.push_back(read_row(i));
    return points;
  }

 private:
  [[noreturn]] void fail(const std::string& field, const std::string& found,
                         const std::string& expected) const {
    throw InputError(file_.path().string(), field, found, expected);
  }
  template <class T>
  bool parse(std::string_view word, T& value) const {
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    return !word.empty() && error == std::errc() && end == word.data() + word.size();
  }

  void read_header() {
    int elements = 0, properties = 0;
    for (std::string_view word; word != "end_header"; words_.end_line()) {
      if (words_.at_end()) fail("header", "no end_header line", "a PLY file");
      word = words_.next();
      if (word == "element") {
        const bool is_first = ++elements == 1;
        if (is_first && (words_.next() != "vertex" || !parse(words_.next(), rows_)))
          fail("first element", "another", "element vertex COUNT");
      } else if (word == "property" && elements == 1) {
        const std::string_view type = words_.next(), name = words_.next();
        if (type == "list") fail("property", "a list", "numbers");
        if (name.size() == 1 && name[0] >= 'x' && name[0] <= 'z')
          column_[static_cast<size_t>(name[0] - 'x')] = properties;
        ++properties;
      }
    }
    for (size_t i = 0; i < 3; ++i) {
      if (column_[i] < 0)
        fail("property " + std::string(1, static_cast<char>('x' + i)), "none", "a float or a double");
    }
    last_column_ = *std::ranges::max_element(column_);
  }

  Vec3<double> read_row(int64_t row) {
    Vec3<double> point(0);
    for (int c = 0; c <= last_column_; ++c) {
      const std::string_view word = words_.next();
      for (int axis = 0; axis < 3; ++axis) {
        if (column_[static_cast<size_t>(axis)] == c && !parse(word, point[axis])) {
          fail("vertex " + std::to_string(row),
               word.empty() ? "nothing" : "\"" + std::string(word.substr(0, 40)) + "\"", "a number");
        }
      }
    }
    words_.end_line();
    return point;
  }

  const InputFile& file_;
  Words words_;
  int64_t rows_ = -1;
  std::array<int, 3> column_{-1, -1, -1};
  int last_column_ = 0;
};

}  // namespace

std::vector<Vec3<double>> read_ply_points(const InputFile& file) {
  constexpr int64_t start_size = 64;
  std::string start(static_cast<size_t>(std::min(file.size(), start_size)), '\0');
  file.read_at(0, std::as_writable_bytes(std::span(start)));
  if (!start.starts_with("ply") || start.find("format ascii") == std::string::npos) return read_binary(file);
  if (file.size() > largest_text) {
    throw InputError(file.path().string(), "", std::to_string(file.size()) + " bytes of text",
                     "at most 256 MiB", "write it in binary");
  }
  std::string text(static_cast<size_t>(file.size()), '\0');
  file.read_at(0, std::as_writable_bytes(std::span(text)));
  return TextReader(file, text).read(file.size());
}

}  // namespace traceflow
