#include "files/npy.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <cstring>
#include <Eigen/Core>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "base/atomic_file.h"
#include "base/error.h"
#include "files/zip.h"
#include "files/zip_writer.h"

namespace traceflow {

static_assert(std::endian::native == std::endian::little, "arrays are read as they stand in the file");

namespace {

constexpr int64_t max_header = 65536;
constexpr std::string_view magic = "\x93NUMPY";

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& field, const std::string& found,
                       const std::string& expected, const std::string& remedy = "save the array again") {
  throw InputError(path.string(), field, found, expected, remedy);
}

// The header from the first character of a key's value on; the header is a Python dictionary.
std::string_view value_of(std::string_view header, const std::filesystem::path& path,
                          const std::string& key) {
  const size_t at = header.find("'" + key + "'");
  const size_t colon = at == std::string_view::npos ? at : header.find(':', at);
  if (colon == std::string_view::npos) fail(path, "header", "no '" + key + "'", "a .npy header");
  const size_t begin = header.find_first_not_of(" \t", colon + 1);
  if (begin == std::string_view::npos) fail(path, "header", "no value for '" + key + "'", "a .npy header");
  return header.substr(begin);
}

std::string quoted(std::string_view text, const std::filesystem::path& path) {
  const size_t end = text.find('\'', 1);
  if (text.front() == '[') fail(path, "descr", "a structured array", "numbers of one type");
  if (text.front() != '\'' || end == std::string_view::npos) fail(path, "descr", "no type", "a .npy header");
  return std::string(text.substr(1, end - 1));
}

Shape parse_shape(std::string_view text, const std::filesystem::path& path) {
  const size_t end = text.find(')');
  if (text.front() != '(' || end == std::string_view::npos) fail(path, "shape", "no tuple", "a .npy header");
  std::vector<int64_t> dims;
  for (size_t i = 1; i < end;) {
    if (text[i] == ' ' || text[i] == ',' || text[i] == 'L') {
      ++i;
      continue;
    }
    int64_t dim = 0;
    if (std::isdigit(static_cast<unsigned char>(text[i])) == 0) {
      fail(path, "shape", std::string(text.substr(0, end + 1)), "a tuple of whole numbers");
    }
    for (; i < end && std::isdigit(static_cast<unsigned char>(text[i])) != 0; ++i) {
      if (dim > INT64_MAX / 16)
        fail(path, "shape", std::string(text.substr(0, end + 1)), "sizes that fit the file");
      dim = dim * 10 + (text[i] - '0');
    }
    dims.push_back(dim);
  }
  if (dims.empty()) dims.push_back(1);
  if (dims.size() > 4)
    fail(path, "shape", std::to_string(dims.size()) + " dimensions", "4 at most", "reshape the array");
  return Shape(dims);
}

template <class T>
void widen(const std::byte* from, int64_t count, float* to) {
  for (int64_t i = 0; i < count; ++i) {
    T value;
    std::memcpy(&value, from + i * static_cast<int64_t>(sizeof(T)), sizeof(T));
    to[i] = static_cast<float>(value);
  }
}

using Widen = void (*)(const std::byte*, int64_t, float*);

// Null for an unsupported type.
Widen widen_for(char kind, int width) {
  if (kind == 'f')
    return width == 2 ? widen<Eigen::half> : width == 4 ? widen<float> : width == 8 ? widen<double> : nullptr;
  if (kind == 'b') return width == 1 ? widen<uint8_t> : nullptr;
  const bool is_signed = kind == 'i';
  if (!is_signed && kind != 'u') return nullptr;
  switch (width) {
    case 1:
      return is_signed ? widen<int8_t> : widen<uint8_t>;
    case 2:
      return is_signed ? widen<int16_t> : widen<uint16_t>;
    case 4:
      return is_signed ? widen<int32_t> : widen<uint32_t>;
    case 8:
      return is_signed ? widen<int64_t> : widen<uint64_t>;
    default:
      return nullptr;
  }
}

// Converts from Fortran order (first index fastest) to C order.
Tensor<float> transpose(const Tensor<float>& fortran) {
  const int rank = fortran.shape().rank();
  int64_t dims[4] = {1, 1, 1, 1};
  for (int r = 0; r < rank; ++r) dims[4 - rank + r] = fortran.dim(r);
  Tensor<float> result;
  result.resize(fortran.shape());
  if (result.empty()) return result;  // any number of empty rows
  int64_t to = 0;
  for (int64_t a = 0; a < dims[0]; ++a)
    for (int64_t b = 0; b < dims[1]; ++b)
      for (int64_t c = 0; c < dims[2]; ++c)
        for (int64_t d = 0; d < dims[3]; ++d)
          result[to++] = fortran[a + dims[0] * (b + dims[1] * (c + dims[2] * d))];
  return result;
}

ZipMember find_member(const InputFile& file, const std::string& name) {
  const std::vector<ZipMember> members = list_zip(file);
  std::string names;
  for (const ZipMember& member : members) {
    if (member.name == name || member.name == name + ".npy") return member;
    names += (names.empty() ? "" : ", ") + member.name;
  }
  if (!name.empty()) fail(file.path(), "", "arrays " + names, "an array named " + name);
  if (members.empty()) fail(file.path(), "", "an archive without arrays", "one array");
  if (members.size() != 1)
    fail(file.path(), "", std::to_string(members.size()) + " arrays (" + names + ")", "one array");
  return members.front();
}

}  // namespace

NpyFile::NpyFile(InputFile file, const std::string& name) : file_(std::move(file)) {
  ZipMember member{.size = file_.size()};
  if (path().extension() == ".npz") member = find_member(file_, name);
  if (member.deflated) {
    file_ = inflate_to_scratch(file_, member);
    member = {.size = file_.size()};
  }
  read_header(member.offset, member.offset + member.size);
}

void NpyFile::read_header(int64_t begin, int64_t end) {
  constexpr int64_t fixed = 12;
  unsigned char prefix[fixed] = {};
  const int64_t available = std::min(fixed, end - begin);
  file_.read_at(begin, std::as_writable_bytes(std::span(prefix).first(static_cast<size_t>(available))));
  if (available < 10 || std::memcmp(prefix, magic.data(), magic.size()) != 0) {
    fail(path(), "", "a file without the .npy signature", "a .npy array");
  }
  const int version = prefix[6];
  if (version < 1 || version > 3)
    fail(path(), "", "format version " + std::to_string(version), "version 1, 2 or 3");
  const int64_t start = version == 1 ? 10 : 12;
  int64_t length = prefix[8] | prefix[9] << 8;
  if (version > 1) length |= int64_t{prefix[10]} << 16 | int64_t{prefix[11]} << 24;
  if (length > max_header || start + length > end - begin) {
    fail(path(), "header", std::to_string(length) + " bytes", "a header within the file, of 64 KiB at most");
  }
  std::string header(static_cast<size_t>(length), '\0');
  file_.read_at(begin + start, std::as_writable_bytes(std::span(header)));
  data_offset_ = begin + start + length;

  const std::string type = quoted(value_of(header, path(), "descr"), path());
  if (type.find('O') != std::string::npos)
    fail(path(), "descr", "an array of Python objects", "numbers of one type");
  if (type.starts_with('>')) fail(path(), "descr", "big-endian " + type, "little-endian numbers");
  kind_ = type.size() >= 3 ? type[1] : '?';
  width_ = type.size() == 3 && std::isdigit(static_cast<unsigned char>(type[2])) != 0 ? type[2] - '0' : 0;
  if (widen_for(kind_, width_) == nullptr) {
    fail(path(), "descr", type, "float16/32/64, a whole number of 8 to 64 bits, or bool");
  }
  fortran_order_ = value_of(header, path(), "fortran_order").starts_with("True");
  shape_ = parse_shape(value_of(header, path(), "shape"), path());

  int64_t elements = 1;
  bool overflows = false;
  for (int r = 0; r < shape_.rank(); ++r) overflows |= __builtin_mul_overflow(elements, shape_[r], &elements);
  if (overflows || elements > (end - data_offset_) / width_) {
    fail(path(), "shape", shape_.to_string(), "an array that the file holds",
         "the file is cut short or broken");
  }
}

Tensor<float> NpyFile::read_elements(int64_t first, const Shape& shape) const {
  constexpr int64_t piece = 1 << 16;
  Tensor<float> result;
  result.resize(shape);
  std::vector<std::byte> bytes(static_cast<size_t>(std::min(piece, result.size()) * width_));
  const Widen widen_piece = widen_for(kind_, width_);
  for (int64_t at = 0; at < result.size(); at += piece) {
    const int64_t count = std::min(piece, result.size() - at);
    file_.read_at(data_offset_ + (first + at) * width_,
                  std::span(bytes).first(static_cast<size_t>(count * width_)));
    widen_piece(bytes.data(), count, result.data() + at);
  }
  return result;
}

Tensor<float> NpyFile::read() const {
  Tensor<float> result = read_elements(0, shape_);
  return fortran_order_ && shape_.rank() > 1 ? transpose(result) : result;
}

Tensor<float> NpyFile::slice(int64_t i) const {
  require(shape_.rank() >= 2 && i >= 0 && i < shape_[0], "a slice lies in the array",
          std::to_string(i) + " of " + shape_.to_string());
  if (fortran_order_) fail(path(), "fortran_order", "True", "C order", "save numpy.ascontiguousarray of it");
  const std::array dims{shape_[1], shape_[2], shape_[3]};
  const Shape shape{std::span(dims).first(static_cast<size_t>(shape_.rank() - 1))};
  return read_elements(i * shape.elements(), shape);
}

Tensor<float> read_npy(InputFile file) { return NpyFile(std::move(file)).read(); }
Tensor<float> read_npy(const std::filesystem::path& path) { return NpyFile(path).read(); }

Tensor<float> read_npz(const std::filesystem::path& path, const std::string& name) {
  return NpyFile(path, name).read();
}

std::vector<std::string> names_in_npz(const std::filesystem::path& path) {
  std::vector<std::string> names;
  for (const ZipMember& member : list_zip(InputFile(path))) {
    const std::string_view name = member.name;
    names.emplace_back(name.ends_with(".npy") ? name.substr(0, name.size() - 4) : name);
  }
  return names;
}

namespace {

template <class T>
std::string npy_bytes(const std::string& type, const Tensor<T>& array) {
  std::string header = "{'descr': '" + type + "', 'fortran_order': False, 'shape': (";
  for (int r = 0; r < array.shape().rank(); ++r)
    header += (r == 0 ? "" : ", ") + std::to_string(array.dim(r));
  header += array.shape().rank() == 1 ? ",), }" : "), }";
  // The data start at a multiple of 64 bytes, and the header's last byte is a newline.
  constexpr size_t fixed = 10;
  header.append(63 - (fixed + header.size()) % 64, ' ').push_back('\n');
  std::string text(magic);
  text += {'\x01', '\x00', static_cast<char>(header.size() & 0xff), static_cast<char>(header.size() >> 8)};
  text += header;
  text.append(reinterpret_cast<const char*>(array.data()), static_cast<size_t>(array.size()) * sizeof(T));
  return text;
}

}  // namespace

void write_npy(const std::filesystem::path& path, const Tensor<float>& array) {
  write_atomically(path, npy_bytes("<f4", array));
}

void write_npy(const std::filesystem::path& path, const Tensor<int32_t>& array) {
  write_atomically(path, npy_bytes("<i4", array));
}

void write_npz(const std::filesystem::path& path,
               const std::vector<std::pair<std::string, const Tensor<float>*>>& arrays) {
  std::vector<ZipEntry> entries;
  entries.reserve(arrays.size());
  for (const auto& [name, array] : arrays) entries.push_back({name + ".npy", npy_bytes("<f4", *array)});
  write_zip(path, entries);
}

}  // namespace traceflow
