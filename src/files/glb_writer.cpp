#include "files/glb_writer.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/version.h"

namespace traceflow {

namespace {

using nlohmann::ordered_json;

static_assert(std::endian::native == std::endian::little, "the file's byte order is the machine's");

// Numbers that the format gives its types.
enum ComponentType { type_uint16 = 5123, type_uint32 = 5125, type_float = 5126 };
enum Target { target_vertices = 34962, target_indices = 34963 };
constexpr uint32_t file_magic = 0x46546C67, json_chunk = 0x4E4F534A, binary_chunk = 0x004E4942;

float linear_from_srgb(float v) { return v <= 0.04045F ? v / 12.92F : std::pow((v + 0.055F) / 1.055F, 2.4F); }

std::vector<uint16_t> linear_colours(const Tensor<float>& colours) {
  std::vector<uint16_t> result;
  result.reserve(static_cast<size_t>(colours.size() / 3 * 4));
  constexpr uint16_t full = std::numeric_limits<uint16_t>::max();
  for (int64_t i = 0; i < colours.dim(0); ++i) {
    for (int64_t c = 0; c < 3; ++c) {
      const float linear = linear_from_srgb(std::clamp(colours(i, c), 0.0F, 1.0F));
      result.push_back(static_cast<uint16_t>(std::lround(linear * full)));
    }
    result.push_back(full);
  }
  return result;
}

// The least or largest coordinates of the vertices.
template <class F>
std::array<float, 3> bound(const Tensor<float>& vertices, F&& choose) {
  std::array<float, 3> result = {vertices(0, 0), vertices(0, 1), vertices(0, 2)};
  for (int64_t i = 0; i < vertices.dim(0); ++i) {
    for (size_t c = 0; c < 3; ++c) result[c] = choose(result[c], vertices(i, static_cast<int64_t>(c)));
  }
  return result;
}

}  // namespace

// The parts of the binary chunk, all of which have multiples of four bytes, with their descriptions.
struct GlbWriter::Parts {
  int64_t vertices = 0;
  std::vector<uint16_t> colours;
  std::vector<std::span<const std::byte>> bytes;
  ordered_json views = ordered_json::array(), accessors = ordered_json::array(), attributes;
  int64_t size = 0;

  // Returns the number of the new accessor.
  template <class T>
  size_t add(std::span<const T> values, Target target, ComponentType type, const char* shape, int64_t count) {
    const auto length = static_cast<int64_t>(values.size_bytes());
    views.push_back({{"buffer", 0}, {"byteOffset", size}, {"byteLength", length}, {"target", target}});
    accessors.push_back(
        {{"bufferView", views.size() - 1}, {"componentType", type}, {"count", count}, {"type", shape}});
    bytes.push_back(std::as_bytes(values));
    size += length;
    return accessors.size() - 1;
  }

  std::string document(GlbPrimitive kind, size_t indices) const {
    ordered_json primitive = {
        {"attributes", attributes}, {"indices", indices}, {"material", 0}, {"mode", static_cast<int>(kind)}};
    ordered_json material = {{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 1}}},
                             {"doubleSided", true}};
    ordered_json node = {{"mesh", 0}, {"rotation", {1, 0, 0, 0}}};
    ordered_json document;
    document["asset"] = {{"version", "2.0"}, {"generator", std::string("traceflow ") + version()}};
    document["scene"] = 0;
    document["scenes"] = {{{"nodes", {0}}}};
    document["nodes"] = ordered_json::array({std::move(node)});
    document["meshes"] = {{{"primitives", ordered_json::array({std::move(primitive)})}}};
    document["materials"] = ordered_json::array({std::move(material)});
    document["accessors"] = accessors;
    document["bufferViews"] = views;
    document["buffers"] = {{{"byteLength", size}}};
    return document.dump();
  }
};

GlbWriter::GlbWriter(const Tensor<float>& positions) : parts_(std::make_unique<Parts>()) {
  parts_->vertices = positions.dim(0);
  const size_t accessor =
      parts_->add(positions.values(), target_vertices, type_float, "VEC3", parts_->vertices);
  parts_->accessors[accessor]["min"] = bound(positions, [](float a, float b) { return std::min(a, b); });
  parts_->accessors[accessor]["max"] = bound(positions, [](float a, float b) { return std::max(a, b); });
  parts_->attributes["POSITION"] = accessor;
}

GlbWriter::~GlbWriter() = default;

void GlbWriter::set_normals(const Tensor<float>& normals) {
  parts_->attributes["NORMAL"] =
      parts_->add(normals.values(), target_vertices, type_float, "VEC3", parts_->vertices);
}

void GlbWriter::set_colours(const Tensor<float>& colours) {
  parts_->colours = linear_colours(colours);
  const size_t accessor = parts_->add(std::span<const uint16_t>(parts_->colours), target_vertices,
                                      type_uint16, "VEC4", parts_->vertices);
  parts_->accessors[accessor]["normalized"] = true;
  parts_->attributes["COLOR_0"] = accessor;
}

void GlbWriter::write(const std::filesystem::path& path, GlbPrimitive primitive,
                      const Tensor<int32_t>& indices) {
  const size_t accessor =
      parts_->add(indices.values(), target_indices, type_uint32, "SCALAR", indices.size());
  std::string json = parts_->document(primitive, accessor);
  json.resize((json.size() + 3) / 4 * 4, ' ');
  const int64_t total = 12 + 8 + static_cast<int64_t>(json.size()) + 8 + parts_->size;
  if (total > std::numeric_limits<uint32_t>::max()) {
    throw InputError(path.string(), "", std::to_string(total) + " bytes", "at most 4294967295",
                     "write .ply, or choose a larger voxel");
  }
  const std::array<uint32_t, 5> head = {file_magic, 2, static_cast<uint32_t>(total),
                                        static_cast<uint32_t>(json.size()), json_chunk};
  const std::array<uint32_t, 2> binary_head = {static_cast<uint32_t>(parts_->size), binary_chunk};
  std::vector<std::span<const std::byte>> file = {
      std::as_bytes(std::span(head)), std::as_bytes(std::span(json)), std::as_bytes(std::span(binary_head))};
  file.insert(file.end(), parts_->bytes.begin(), parts_->bytes.end());
  write_atomically(path, file);
}

}  // namespace traceflow
