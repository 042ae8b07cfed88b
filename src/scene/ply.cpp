#include "scene/ply.h"

#include <fmt/format.h>

#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <optional>
#include <set>
#include <sstream>
#include <string_view>
#include <vector>

#include "base/atomic_file.h"
#include "files/input_file.h"
#include "math/spherical_harmonics.h"

namespace traceflow {

namespace {

static_assert(std::endian::native == std::endian::little, "the file's byte order is the machine's");

constexpr int64_t header_cap = 65536;
constexpr int64_t property_cap = 512;
constexpr int64_t rows_at_a_time = 4096;

enum class Scalar { i8, u8, i16, u16, i32, u32, f32, f64 };

struct Property {
  std::string name;
  Scalar type;
  int64_t offset;  // bytes from the start of the row
};

struct Header {
  int64_t rows = 0;
  int64_t row_bytes = 0;
  int64_t bytes = 0;  // of the header itself
  std::vector<Property> properties;
  std::map<std::string, std::string> notes;

  const Property* find(const std::string& name) const {
    for (const Property& p : properties) {
      if (p.name == name) return &p;
    }
    return nullptr;
  }
};

constexpr const char* remedy = "write it with 2DGS or `traceflow export`";

std::optional<Scalar> scalar_named(const std::string& name) {
  static const std::map<std::string, Scalar> names = {
      {"char", Scalar::i8},   {"int8", Scalar::i8},     {"uchar", Scalar::u8},   {"uint8", Scalar::u8},
      {"short", Scalar::i16}, {"int16", Scalar::i16},   {"ushort", Scalar::u16}, {"uint16", Scalar::u16},
      {"int", Scalar::i32},   {"int32", Scalar::i32},   {"uint", Scalar::u32},   {"uint32", Scalar::u32},
      {"float", Scalar::f32}, {"float32", Scalar::f32}, {"double", Scalar::f64}, {"float64", Scalar::f64}};
  const auto found = names.find(name);
  if (found == names.end()) return std::nullopt;
  return found->second;
}

int64_t bytes_of(Scalar type) {
  constexpr std::array<int64_t, 8> sizes = {1, 1, 2, 2, 4, 4, 4, 8};
  return sizes[static_cast<size_t>(type)];
}

template <class T>
float load_as_float(const std::byte* p) {
  T value;
  std::memcpy(&value, p, sizeof value);
  return static_cast<float>(value);
}

float load_scalar(Scalar type, const std::byte* p) {
  switch (type) {
    case Scalar::i8:
      return load_as_float<int8_t>(p);
    case Scalar::u8:
      return load_as_float<uint8_t>(p);
    case Scalar::i16:
      return load_as_float<int16_t>(p);
    case Scalar::u16:
      return load_as_float<uint16_t>(p);
    case Scalar::i32:
      return load_as_float<int32_t>(p);
    case Scalar::u32:
      return load_as_float<uint32_t>(p);
    case Scalar::f32:
      return load_as_float<float>(p);
    case Scalar::f64:
      return load_as_float<double>(p);
  }
  return 0;
}

// What was found, cut to a length that keeps the message one line.
std::string one_line(std::string_view text) {
  std::string clean;
  for (const char c : text.substr(0, 60)) clean += c >= 32 && c < 127 ? c : '?';
  return "\"" + clean + (text.size() > 60 ? "…\"" : "\"");
}

// The header's text, up to and with the end_header line.
std::string read_header_text(const InputFile& file) {
  std::string text(static_cast<size_t>(std::min(file.size(), header_cap)), '\0');
  file.read_at(0, std::as_writable_bytes(std::span(text.data(), text.size())));
  if (!text.starts_with("ply\n") && !text.starts_with("ply\r\n")) {
    throw InputError(file.path().string(), "first line", one_line(text.substr(0, text.find('\n'))), "\"ply\"",
                     remedy);
  }
  for (size_t line = 0; line < text.size();) {
    const size_t end = text.find('\n', line);
    if (end == std::string::npos) break;
    const std::string_view words = std::string_view(text).substr(line, end - line);
    if (words == "end_header" || words == "end_header\r") return text.substr(0, end + 1);
    line = end + 1;
  }
  throw InputError(file.path().string(), "header", "no end_header line",
                   fmt::format("one within the first {} bytes", header_cap), remedy);
}

// Reads the header line by line, strictly: a line that it does not know is an error.
class HeaderParser {
 public:
  explicit HeaderParser(const InputFile& file) : path_(file.path().string()) {
    const std::string text = read_header_text(file);
    header_.bytes = static_cast<int64_t>(text.size());
    std::istringstream lines(text);
    std::string line;
    std::getline(lines, line);
    while (std::getline(lines, line)) {
      if (!line.empty() && line.back() == '\r') line.pop_back();
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
  Header result() { return std::move(header_); }

 private:
  [[noreturn]] void fail(const std::string& field, const std::string& found,
                         const std::string& expected) const {
    throw InputError(path_, field, found, expected, remedy);
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
    const std::optional<Scalar> scalar = scalar_named(type);
    if (!scalar || name.empty()) fail("property", one_line(line), "a scalar type and a name");
    if (!names_.insert(name).second) fail("property " + one_line(name), "two of it", "one");
    if (names_.size() > property_cap) fail("property", "more than 512", "the attributes of 2DGS");
    header_.properties.push_back({name, *scalar, header_.row_bytes});
    header_.row_bytes += bytes_of(*scalar);
  }

  std::string path_;
  Header header_;
  std::set<std::string> names_;
  int elements_ = 0;
  bool format_seen_ = false;
};

[[noreturn]] void missing_attribute(const std::string& path, const std::string& name) {
  throw InputError(path, "property " + name, "none", "every attribute of 2DGS", remedy);
}

// Where one property of a row goes: destination[row · stride].
struct Column {
  Scalar type;
  int64_t offset;
  float* destination;
  int64_t stride;
};

class ColumnPlan {
 public:
  ColumnPlan(std::string path, const Header& header) : path_(std::move(path)), header_(header) {}

  // Maps properties prefix_0, prefix_1, … (or the given names) to consecutive numbers of a tensor's row.
  void add(const std::vector<std::string>& names, Tensor<float>& tensor) {
    for (size_t i = 0; i < names.size(); ++i) add_one(names[i], tensor.data() + i, tensor.row_size());
  }
  void add_one(const std::string& name, float* destination, int64_t stride) {
    const Property* p = header_.find(name);
    if (p == nullptr) missing_attribute(path_, name);
    columns_.push_back({p->type, p->offset, destination, stride});
  }
  const std::vector<Column>& columns() const { return columns_; }

 private:
  std::string path_;
  const Header& header_;
  std::vector<Column> columns_;
};

// Before memory is taken: a header that lacks an attribute could promise any number of rows.
void require_attributes(const std::string& path, const Header& header) {
  for (const char* name : {"x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1",
                           "rot_0", "rot_1", "rot_2", "rot_3"}) {
    if (header.find(name) == nullptr) missing_attribute(path, name);
  }
}

int rest_count(const std::string& path, const Header& header) {
  int count = 0;
  for (const Property& p : header.properties) count += p.name.starts_with("f_rest_") ? 1 : 0;
  if (count != 0 && count != 9 && count != 24 && count != 45) {
    throw InputError(path, "f_rest_*", std::to_string(count) + " of them", "0, 9, 24 or 45 (degree 0 to 3)",
                     remedy);
  }
  return count;
}

void read_rows(const InputFile& file, const Header& header, const std::vector<Column>& columns) {
  std::vector<std::byte> buffer(
      static_cast<size_t>(std::min(header.rows, rows_at_a_time) * header.row_bytes));
  for (int64_t first = 0; first < header.rows; first += rows_at_a_time) {
    const int64_t rows = std::min(rows_at_a_time, header.rows - first);
    file.read_at(header.bytes + first * header.row_bytes,
                 std::span(buffer.data(), static_cast<size_t>(rows * header.row_bytes)));
    for (int64_t r = 0; r < rows; ++r) {
      const std::byte* row = buffer.data() + r * header.row_bytes;
      for (const Column& c : columns)
        c.destination[(first + r) * c.stride] = load_scalar(c.type, row + c.offset);
    }
  }
}

std::vector<std::string> written_properties(const Surfels& surfels) {
  std::vector<std::string> names = {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"};
  for (int64_t i = 0; i < 3 * (surfels.sh.dim(1) - 1); ++i) names.push_back("f_rest_" + std::to_string(i));
  for (const char* name : {"opacity", "scale_0", "scale_1", "rot_0", "rot_1", "rot_2", "rot_3"})
    names.emplace_back(name);
  if (surfels.has_tint()) names.emplace_back("tint");
  return names;
}

// One surfel's numbers in the order of written_properties.
void append_row(const Surfels& s, int64_t i, std::vector<float>& out) {
  const int64_t k = s.sh.dim(1);
  const float* sh = s.sh.row(i);
  out.insert(out.end(), s.position.row(i), s.position.row(i) + 3);
  out.insert(out.end(), 3, 0.0F);
  out.insert(out.end(), sh, sh + 3);
  for (int64_t channel = 0; channel < 3; ++channel) {
    for (int64_t c = 1; c < k; ++c) out.push_back(sh[3 * c + channel]);
  }
  out.push_back(s.opacity_logit[i]);
  out.insert(out.end(), s.log_scale.row(i), s.log_scale.row(i) + 2);
  out.insert(out.end(), s.rotation.row(i), s.rotation.row(i) + 4);
  if (s.has_tint()) out.push_back(s.tint_logit[i]);
}

}  // namespace

PlyScene read_ply(const std::filesystem::path& path) {
  const InputFile file(path);
  const Header header = HeaderParser(file).result();
  if (header.find("scale_2") != nullptr) {
    throw InputError(path.string(), "property scale_2", "three scales, a 3DGS scene of ellipsoids",
                     "two, the surfels of 2DGS", "retrain with 2DGS or `traceflow train`");
  }
  require_attributes(path.string(), header);
  const int rest = rest_count(path.string(), header);
  const int64_t n = header.rows;
  const int64_t k = 1 + rest / 3;

  PlyScene scene;
  scene.notes = header.notes;
  Surfels& s = scene.surfels;
  s.position = Tensor<float>(Shape{n, 3});
  s.log_scale = Tensor<float>(Shape{n, 2});
  s.rotation = Tensor<float>(Shape{n, 4});
  s.opacity_logit = Tensor<float>(Shape{n});
  s.sh = Tensor<float>(Shape{n, k, 3});
  ColumnPlan plan(path.string(), header);
  plan.add({"x", "y", "z"}, s.position);
  plan.add({"scale_0", "scale_1"}, s.log_scale);
  plan.add({"rot_0", "rot_1", "rot_2", "rot_3"}, s.rotation);
  plan.add({"opacity"}, s.opacity_logit);
  plan.add({"f_dc_0", "f_dc_1", "f_dc_2"}, s.sh);
  for (int64_t channel = 0; channel < 3; ++channel) {
    for (int64_t c = 1; c < k; ++c) {
      plan.add_one("f_rest_" + std::to_string(channel * (k - 1) + c - 1), s.sh.data() + 3 * c + channel,
                   3 * k);
    }
  }
  if (header.find("tint") != nullptr) {
    s.tint_logit = Tensor<float>(Shape{n});
    plan.add({"tint"}, s.tint_logit);
  }
  read_rows(file, header, plan.columns());
  return scene;
}

void write_ply(const std::filesystem::path& path, const PlyScene& scene) {
  const Surfels& surfels = scene.surfels;
  require(surfels.sh.shape().rank() == 3, "surfels have harmonics", surfels.sh.shape().to_string());
  const std::vector<std::string> names = written_properties(surfels);
  std::string bytes = "ply\nformat binary_little_endian 1.0\n";
  for (const auto& [key, value] : scene.notes) bytes += "comment traceflow " + key + " " + value + "\n";
  bytes += fmt::format("element vertex {}\n", surfels.count());
  for (const std::string& name : names) bytes += "property float " + name + "\n";
  bytes += "end_header\n";

  std::vector<float> row;
  bytes.reserve(bytes.size() + static_cast<size_t>(surfels.count()) * names.size() * sizeof(float));
  for (int64_t i = 0; i < surfels.count(); ++i) {
    row.clear();
    append_row(surfels, i, row);
    bytes.append(reinterpret_cast<const char*>(row.data()), row.size() * sizeof(float));
  }
  write_atomically(path, bytes);
}

void undo_normalisation(const SceneNormalisation& normalisation, Surfels& surfels) {
  const auto log_factor = static_cast<float>(std::log(normalisation.scale));
  for (int64_t i = 0; i < surfels.count(); ++i) {
    store3(surfels.position.row(i),
           load3<double>(surfels.position.row(i)) / normalisation.scale + normalisation.centre);
  }
  for (float& log_scale : surfels.log_scale.values()) log_scale -= log_factor;
}

}  // namespace traceflow
