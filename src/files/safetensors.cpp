#include "files/safetensors.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstring>
#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <set>
#include <span>
#include <string_view>

#include "base/atomic_file.h"
#include "base/error.h"
#include "files/input_file.h"
#include "files/json_document.h"

namespace traceflow {

static_assert(std::endian::native == std::endian::little, "numbers are read as they stand in the file");

namespace {

using Json = nlohmann::json;

constexpr uint64_t length_bytes = 8;
constexpr uint64_t max_header_bytes = 100'000'000;  // the format's limit
constexpr size_t max_rank = 4;
constexpr int deepest_header = 8;
constexpr const char* metadata_key = "__metadata__";
constexpr const char* checksums_key = "traceflow.crc32";

struct Type {
  std::string_view name;
  uint64_t bytes;
};
constexpr std::array<Type, 7> types{
    {{"F64", 8}, {"I64", 8}, {"F32", 4}, {"I32", 4}, {"F16", 2}, {"BF16", 2}, {"U8", 1}}};

const Type* find_type(std::string_view name) {
  const auto* const found = std::ranges::find(types, name, &Type::name);
  return found == types.end() ? nullptr : found;
}

template <class T>
constexpr const char* type_name() {
  if constexpr (std::is_same_v<T, float>) return "F32";
  if constexpr (std::is_same_v<T, double>) return "F64";
  if constexpr (std::is_same_v<T, int32_t>) return "I32";
  if constexpr (std::is_same_v<T, int64_t>) return "I64";
  if constexpr (std::is_same_v<T, uint8_t>) return "U8";
}

// One tensor as the header describes it. Checked alone, but not yet against its neighbours.
struct Described {
  std::string name;
  Type type;
  Shape shape;
  uint64_t begin;
  uint64_t end;
};

// Text from a file made printable: one short line without control characters.
std::string shown(const std::string& text) {
  std::string result = text.substr(0, 80);
  for (char& c : result) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) c = '?';
  }
  return text.size() > 80 ? result + "..." : result;
}

std::string shown(const Json& value) {
  return shown(value.dump(-1, ' ', false, Json::error_handler_t::replace));
}

// Parses the header. Rejects duplicate names, since readers would differ on which one counts, and deeper
// nesting than any header has, since printing it would overflow the stack.
Json parse_header(const std::string& text, const std::string& origin) {
  const JsonExtent extent = json_extent(text);
  if (extent.depth > deepest_header)
    throw InputError(origin, "header", "JSON nested too deep", "a safetensors header");
  if (extent.values > max_json_values) {
    throw InputError(origin, "header", std::to_string(extent.values) + " values",
                     "at most " + std::to_string(max_json_values));
  }
  std::set<std::string> names;
  const auto check = [&](int depth, Json::parse_event_t event, Json& value) {
    if (event == Json::parse_event_t::key && depth == 1 && !names.insert(value.get<std::string>()).second) {
      throw InputError(origin, "header", "the name " + shown(value) + " twice", "every tensor once");
    }
    return true;
  };
  try {
    Json header = Json::parse(text, check);
    if (!header.is_object()) throw InputError(origin, "header", shown(header), "a JSON object");
    return header;
  } catch (const Json::exception&) {
    throw InputError(origin, "header", "text that is not JSON", "a JSON object");
  }
}

Json read_header(const InputFile& file, const std::string& origin, uint64_t& data_start) {
  const auto file_size = static_cast<uint64_t>(file.size());
  if (file_size < length_bytes) {
    throw InputError(origin, "", std::to_string(file_size) + " bytes",
                     "a safetensors file of 8 bytes or more");
  }
  uint64_t header_bytes = 0;
  file.read_at(0, std::as_writable_bytes(std::span(&header_bytes, 1)));
  const uint64_t limit = std::min(max_header_bytes, file_size - length_bytes);
  if (header_bytes > limit) {
    throw InputError(origin, "header length", std::to_string(header_bytes),
                     "at most " + std::to_string(limit),
                     "the file is cut short or is not a safetensors file");
  }
  std::string text(header_bytes, '\0');
  file.read_at(length_bytes, std::as_writable_bytes(std::span(text)));
  data_start = length_bytes + header_bytes;
  return parse_header(text, origin);
}

uint64_t unsigned_number(const Json& value, const std::string& origin, const std::string& field) {
  if (!value.is_number_unsigned())
    throw InputError(origin, field, shown(value), "a number that is not negative");
  return value.get<uint64_t>();
}

// Also computes the number of elements, which must fit in 63 bits.
Shape parse_shape(const Json& dims, const std::string& origin, const std::string& field, uint64_t& elements) {
  if (!dims.is_array() || dims.size() > max_rank) {
    throw InputError(origin, field, shown(dims), "a list of at most 4 dimensions");
  }
  std::array<int64_t, max_rank> sizes{};
  int64_t product = 1;
  for (size_t i = 0; i < dims.size(); ++i) {
    const uint64_t size = unsigned_number(dims[i], origin, field);
    const bool fits = size <= static_cast<uint64_t>(INT64_MAX);
    if (!fits || __builtin_mul_overflow(product, static_cast<int64_t>(size), &product)) {
      throw InputError(origin, field, shown(dims), "a size that fits 63 bits");
    }
    sizes[i] = static_cast<int64_t>(size);
  }
  elements = static_cast<uint64_t>(product);
  // A scalar is one number.
  return dims.empty() ? Shape{1} : Shape(std::span(sizes).first(dims.size()));
}

Described parse_entry(const std::string& name, const Json& entry, const std::string& origin,
                      uint64_t data_bytes) {
  const std::string field = "tensor " + shown(name);
  if (!entry.is_object() || !entry.contains("dtype") || !entry.contains("shape") ||
      !entry.contains("data_offsets")) {
    throw InputError(origin, field, shown(entry), "an object with dtype, shape and data_offsets");
  }
  const Json& dtype = entry["dtype"];
  const Type* type = dtype.is_string() ? find_type(dtype.get<std::string>()) : nullptr;
  if (type == nullptr) {
    throw InputError(origin, field + " dtype", shown(dtype), "F32, F64, I32, I64, U8, F16 or BF16");
  }
  uint64_t elements = 0;
  const Shape shape = parse_shape(entry["shape"], origin, field + " shape", elements);
  const Json& offsets = entry["data_offsets"];
  if (!offsets.is_array() || offsets.size() != 2) {
    throw InputError(origin, field + " data_offsets", shown(offsets), "two numbers");
  }
  const uint64_t begin = unsigned_number(offsets[0], origin, field + " data_offsets");
  const uint64_t end = unsigned_number(offsets[1], origin, field + " data_offsets");
  if (begin > end || end > data_bytes) {
    throw InputError(origin, field + " data_offsets", shown(offsets),
                     "a range within " + std::to_string(data_bytes) + " bytes of data");
  }
  if (elements > (end - begin) / type->bytes || elements * type->bytes != end - begin) {
    throw InputError(origin, field + " data_offsets", std::to_string(end - begin) + " bytes",
                     shape.to_string() + " elements of " + std::to_string(type->bytes) + " bytes");
  }
  return {name, *type, shape, begin, end};
}

std::map<std::string, std::string> parse_metadata(const Json& metadata, const std::string& origin) {
  if (!metadata.is_object()) throw InputError(origin, metadata_key, shown(metadata), "an object of strings");
  std::map<std::string, std::string> result;
  for (const auto& [key, value] : metadata.items()) {
    if (!value.is_string()) throw InputError(origin, "metadata " + shown(key), shown(value), "a string");
    result[key] = value.get<std::string>();
  }
  return result;
}

// The tensors must tile the data, without overlap or gaps, as the format requires.
void check_tiling(const std::vector<Described>& tensors, const std::string& origin, uint64_t data_bytes) {
  uint64_t next = 0;
  for (const Described& t : tensors) {
    if (t.begin != next) {
      throw InputError(origin, "tensor " + shown(t.name) + " data_offsets",
                       "a start at " + std::to_string(t.begin),
                       std::to_string(next) + ", where the one before ends");
    }
    next = t.end;
  }
  if (next != data_bytes) {
    throw InputError(origin, "", std::to_string(data_bytes) + " bytes of data", std::to_string(next));
  }
}

Json shape_list(const Shape& shape) {
  Json dims = Json::array();
  for (int i = 0; i < shape.rank(); ++i) dims.push_back(shape[i]);
  return shape.rank() == 0 ? Json::array({0}) : dims;
}

std::string checksum(std::string_view head, std::span<const std::byte> bytes) {
  uLong crc = crc32_z(0, reinterpret_cast<const Bytef*>(head.data()), head.size());
  // For a null address zlib returns its initial value.
  if (!bytes.empty()) crc = crc32_z(crc, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size());
  return fmt::format("{:08x}", crc);
}

std::string checksum(std::string_view type, const Shape& shape, std::span<const std::byte> bytes) {
  return checksum(std::string(type) + shape_list(shape).dump(), bytes);
}

// Computed from the text as written, in which invalid UTF-8 bytes have been replaced.
std::string checksum(const std::map<std::string, std::string>& metadata) {
  return checksum(Json(metadata).dump(-1, ' ', false, Json::error_handler_t::replace), {});
}

// The checksums stored in a file: {"metadata": "89abcdef", "tensors": {NAME: "01234567", …}}.
class Checksums {
 public:
  // Removes them from the metadata and verifies the metadata's own checksum.
  Checksums(std::map<std::string, std::string>& metadata, std::string origin) : origin_(std::move(origin)) {
    const auto found = metadata.find(checksums_key);
    if (found == metadata.end()) return;
    const bool fits = json_extent(found->second).values <= max_json_values;
    Json json = fits ? Json::parse(found->second, nullptr, false) : Json();
    metadata.erase(found);
    if (!json.is_object() || !json.contains("metadata") || !json.contains("tensors") ||
        !json["tensors"].is_object()) {
      throw InputError(origin_, "metadata", "checksums that cannot be read", "those of metadata and tensors",
                       remedy);
    }
    compare("metadata", checksum(metadata), json["metadata"]);
    tensors_ = std::move(json["tensors"]);
  }
  bool exist() const { return tensors_.is_object(); }

  void check_names(const std::vector<Described>& tensors) const {
    std::set<std::string_view> names;
    for (const Described& t : tensors) names.insert(t.name);
    for (const auto& [name, value] : tensors_.items()) {
      if (names.count(name) == 0)
        throw InputError(origin_, "tensor " + shown(name), "nothing", "this tensor", remedy);
    }
  }
  void check(const Described& tensor, std::span<const std::byte> bytes) const {
    const auto expected = tensors_.find(tensor.name);
    compare("tensor " + shown(tensor.name), checksum(tensor.type.name, tensor.shape, bytes),
            expected == tensors_.end() ? Json() : *expected);
  }

 private:
  static constexpr const char* remedy = "the file is damaged";

  void compare(const std::string& section, const std::string& found, const Json& expected) const {
    if (expected == found) return;
    throw InputError(origin_, section, "bytes with the checksum " + found,
                     expected.is_string() ? shown(expected.get<std::string>()) : "a checksum", remedy);
  }

  std::string origin_;
  Json tensors_;
};

template <class Narrow>
std::vector<std::byte> widened(const std::vector<std::byte>& narrow) {
  std::vector<std::byte> wide(narrow.size() * 2);
  for (size_t i = 0; i < narrow.size() / 2; ++i) {
    Narrow value{};
    std::memcpy(&value, narrow.data() + 2 * i, sizeof value);
    const auto wide_value = static_cast<float>(value);
    std::memcpy(wide.data() + 4 * i, &wide_value, sizeof wide_value);
  }
  return wide;
}

}  // namespace

Safetensors Safetensors::read(const std::filesystem::path& path) {
  Safetensors result;
  result.origin_ = path.string();
  const InputFile file(path);
  uint64_t data_start = 0;
  const Json header = read_header(file, result.origin_, data_start);
  const uint64_t data_bytes = static_cast<uint64_t>(file.size()) - data_start;

  std::vector<Described> tensors;
  for (const auto& [name, entry] : header.items()) {
    if (name == metadata_key) {
      result.metadata = parse_metadata(entry, result.origin_);
    } else {
      tensors.push_back(parse_entry(name, entry, result.origin_, data_bytes));
    }
  }
  std::ranges::sort(tensors, [](const Described& a, const Described& b) {
    return std::pair(a.begin, a.end) < std::pair(b.begin, b.end);
  });
  check_tiling(tensors, result.origin_, data_bytes);
  const Checksums checksums(result.metadata, result.origin_);
  result.has_checksums_ = checksums.exist();
  if (checksums.exist()) checksums.check_names(tensors);

  for (const Described& t : tensors) {
    std::vector<std::byte> bytes(t.end - t.begin);
    file.read_at(static_cast<int64_t>(data_start + t.begin), bytes);
    if (checksums.exist()) checksums.check(t, bytes);
    std::string type(t.type.name);
    if (type == "F16" || type == "BF16") {
      bytes = type == "F16" ? widened<Eigen::half>(bytes) : widened<Eigen::bfloat16>(bytes);
      type = "F32";
    }
    result.entries_[t.name] = {type, t.shape, std::move(bytes)};
  }
  return result;
}

template <class T>
void Safetensors::add(const std::string& name, const Tensor<T>& tensor) {
  std::vector<std::byte> bytes(static_cast<size_t>(tensor.size()) * sizeof(T));
  memory::copy(Device::cpu, bytes.data(), tensor.device(), tensor.data(), bytes.size());
  entries_[name] = {type_name<T>(), tensor.shape(), std::move(bytes)};
}

void Safetensors::write(const std::filesystem::path& path) const {
  require(!has(metadata_key), "no tensor takes the metadata's name");
  require(metadata.count(checksums_key) == 0, "no metadata take the checksums' name");
  // Wide types come first, so that every tensor starts at a multiple of its element size.
  std::vector<std::pair<const std::string*, const Entry*>> order;
  for (const auto& [name, entry] : entries_) order.emplace_back(&name, &entry);
  std::ranges::stable_sort(order, [](const auto& a, const auto& b) {
    return find_type(a.second->type)->bytes > find_type(b.second->type)->bytes;
  });

  Json header = Json::object();
  Json checksums{{"metadata", checksum(metadata)}, {"tensors", Json::object()}};
  uint64_t offset = 0;
  for (const auto& [name, entry] : order) {
    checksums["tensors"][*name] = checksum(entry->type, entry->shape, entry->bytes);
    header[*name] = {{"dtype", entry->type},
                     {"shape", shape_list(entry->shape)},
                     {"data_offsets", {offset, offset + entry->bytes.size()}}};
    offset += entry->bytes.size();
  }
  header[metadata_key] = metadata;
  header[metadata_key][checksums_key] = checksums.dump(-1, ' ', false, Json::error_handler_t::replace);
  std::string text = header.dump(-1, ' ', false, Json::error_handler_t::replace);
  text.resize((text.size() + 7) / 8 * 8, ' ');

  const uint64_t length = text.size();
  std::vector<std::span<const std::byte>> parts{std::as_bytes(std::span(&length, 1)),
                                                std::as_bytes(std::span(text))};
  for (const auto& [name, entry] : order) parts.emplace_back(entry->bytes);
  write_atomically(path, parts);
}

bool Safetensors::has(const std::string& name) const { return entries_.count(name) != 0; }

std::vector<std::string> Safetensors::names() const {
  std::vector<std::string> result;
  for (const auto& [name, entry] : entries_) result.push_back(name);
  return result;
}

const std::string& Safetensors::text(const std::string& key) const {
  const auto found = metadata.find(key);
  if (found == metadata.end()) {
    throw InputError(origin_, key, "nothing", "the metadata that `traceflow train` writes");
  }
  return found->second;
}

double Safetensors::number(const std::string& key) const {
  const std::string& text = this->text(key);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !(value >= 0 && value <= 1e15)) {
    throw InputError(origin_, key, shown(text), "a number");
  }
  return value;
}

template <class T>
Tensor<T> Safetensors::tensor(const std::string& name) const {
  const auto found = entries_.find(name);
  if (found == entries_.end()) throw InputError(origin_, "tensor " + shown(name), "none", "this tensor");
  const Entry& entry = found->second;
  if (entry.type != type_name<T>()) {
    throw InputError(origin_, "tensor " + shown(name), "type " + entry.type, type_name<T>());
  }
  Tensor<T> result(entry.shape);
  if (!entry.bytes.empty()) std::memcpy(result.data(), entry.bytes.data(), entry.bytes.size());
  return result;
}

template void Safetensors::add(const std::string&, const Tensor<float>&);
template void Safetensors::add(const std::string&, const Tensor<double>&);
template void Safetensors::add(const std::string&, const Tensor<int32_t>&);
template void Safetensors::add(const std::string&, const Tensor<int64_t>&);
template void Safetensors::add(const std::string&, const Tensor<uint8_t>&);
template Tensor<float> Safetensors::tensor(const std::string&) const;
template Tensor<double> Safetensors::tensor(const std::string&) const;
template Tensor<int32_t> Safetensors::tensor(const std::string&) const;
template Tensor<int64_t> Safetensors::tensor(const std::string&) const;
template Tensor<uint8_t> Safetensors::tensor(const std::string&) const;

}  // namespace traceflow
