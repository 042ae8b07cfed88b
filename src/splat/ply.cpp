#include "splat/ply.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <span>
#include <string_view>
#include <vector>

#include "base/atomic_file.h"
#include "files/ply_header.h"
#include "math/types.h"
#include "splat/gaussians.h"

namespace traceflow {

namespace {

static_assert(std::endian::native == std::endian::little, "the file's byte order is the machine's");

constexpr int64_t rows_at_a_time = 4096;

template <class T>
float load_as_float(const std::byte* p) {
  T value;
  std::memcpy(&value, p, sizeof value);
  return static_cast<float>(value);
}

float load_scalar(PlyScalar type, const std::byte* p) {
  switch (type) {
    case PlyScalar::i8:
      return load_as_float<int8_t>(p);
    case PlyScalar::u8:
      return load_as_float<uint8_t>(p);
    case PlyScalar::i16:
      return load_as_float<int16_t>(p);
    case PlyScalar::u16:
      return load_as_float<uint16_t>(p);
    case PlyScalar::i32:
      return load_as_float<int32_t>(p);
    case PlyScalar::u32:
      return load_as_float<uint32_t>(p);
    case PlyScalar::f32:
      return load_as_float<float>(p);
    case PlyScalar::f64:
      return load_as_float<double>(p);
  }
  return 0;
}

[[noreturn]] void missing_attribute(const std::string& path, const std::string& name) {
  throw InputError(path, "property " + name, "none", "every attribute of 2DGS", ply_remedy);
}

// Where one property of a row is stored: rows[row · stride + number]. rows: null if nowhere.
struct Column {
  PlyScalar type;
  int64_t offset;
  float* rows;
  int64_t stride, number;
};

class ColumnPlan {
 public:
  ColumnPlan(std::string path, const PlyHeader& header) : path_(std::move(path)), header_(header) {}

  // Maps properties to consecutive numbers of a tensor's row; skips empty names.
  void add(std::span<const std::string_view> names, Tensor<float>& tensor) {
    for (size_t i = 0; i < names.size() && !names[i].empty(); ++i)
      add_one(std::string(names[i]), tensor, static_cast<int64_t>(i));
  }
  void add_one(const std::string& name, Tensor<float>& tensor, int64_t number) {
    const PlyProperty* p = header_.find(name);
    if (p == nullptr) missing_attribute(path_, name);
    columns_.push_back({p->type, p->offset, tensor.data(), tensor.row_size(), number});
  }
  const std::vector<Column>& columns() const { return columns_; }

 private:
  std::string path_;
  const PlyHeader& header_;
  std::vector<Column> columns_;
};

// Checked before memory is allocated: a header that lacks an attribute could promise any number of rows.
void require_attributes(const std::string& path, const PlyHeader& header) {
  for_each_field([&](const SurfelField& field) {
    for (const std::string_view name : field.ply) {
      if (!field.is_optional && !name.empty() && header.find(std::string(name)) == nullptr)
        missing_attribute(path, std::string(name));
    }
  });
}

int rest_count(const std::string& path, const PlyHeader& header) {
  int count = 0;
  for (const PlyProperty& p : header.properties) count += p.name.starts_with("f_rest_") ? 1 : 0;
  if (count != 0 && count != 9 && count != 24 && count != 45) {
    throw InputError(path, "f_rest_*", std::to_string(count) + " of them", "0, 9, 24 or 45 (degree 0 to 3)",
                     ply_remedy);
  }
  return count;
}

void read_rows(const InputFile& file, const PlyHeader& header, const std::vector<Column>& columns) {
  std::vector<std::byte> buffer(
      static_cast<size_t>(std::min(header.rows, rows_at_a_time) * header.row_bytes));
  for (int64_t first = 0; first < header.rows; first += rows_at_a_time) {
    const int64_t rows = std::min(rows_at_a_time, header.rows - first);
    file.read_at(header.bytes + first * header.row_bytes,
                 std::span(buffer.data(), static_cast<size_t>(rows * header.row_bytes)));
    for (int64_t r = 0; r < rows; ++r) {
      const std::byte* row = buffer.data() + r * header.row_bytes;
      for (const Column& c : columns)
        c.rows[(first + r) * c.stride + c.number] = load_scalar(c.type, row + c.offset);
    }
  }
}

std::vector<std::string> written_properties(const Surfels& surfels, PlyVertex vertex) {
  std::vector<std::string> names = {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"};
  for (int64_t i = 0; i < 3 * (surfels.sh.dim(1) - 1); ++i) names.push_back("f_rest_" + std::to_string(i));
  for (const char* name : {"opacity", "scale_0", "scale_1"}) names.emplace_back(name);
  if (vertex == PlyVertex::gaussian) names.emplace_back("scale_2");
  for (const char* name : {"rot_0", "rot_1", "rot_2", "rot_3"}) names.emplace_back(name);
  if (surfels.has_tint()) names.emplace_back("tint");
  if (surfels.has_roughness()) names.emplace_back("roughness");
  return names;
}

// One surfel's numbers in the order of written_properties.
void append_row(const Surfels& s, int64_t i, PlyVertex vertex, std::vector<float>& out) {
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
  if (vertex == PlyVertex::gaussian) out.push_back(log_thickness(s, i));
  out.insert(out.end(), s.rotation.row(i), s.rotation.row(i) + 4);
  if (s.has_tint()) out.push_back(s.tint_logit[i]);
  if (s.has_roughness()) out.push_back(s.roughness_logit[i]);
}

}  // namespace

PlyScene read_ply(const std::filesystem::path& path) {
  const InputFile file(path);
  const PlyHeader header = read_ply_header(file);
  require_attributes(path.string(), header);
  const int rest = rest_count(path.string(), header);
  const int64_t n = header.rows;
  const int64_t k = 1 + rest / 3;

  PlyScene scene;
  scene.notes = header.notes;
  Surfels& s = scene.surfels;
  ColumnPlan plan(path.string(), header);
  Tensor<float> log_scales;
  for_each_field(
      [&](const SurfelField& field, Tensor<float>& tensor) {
        if (field.is_optional && header.find(std::string(field.ply[0])) == nullptr) return;
        tensor = Tensor<float>(field.width == 0   ? Shape{n, k, 3}
                               : field.width == 1 ? Shape{n}
                                                  : Shape{n, field.width});
        plan.add(field.ply, tensor);
      },
      s);
  for (int64_t channel = 0; channel < 3; ++channel) {
    for (int64_t c = 1; c < k; ++c) {
      plan.add_one("f_rest_" + std::to_string(channel * (k - 1) + c - 1), s.sh, 3 * c + channel);
    }
  }
  if (header.find("scale_2") != nullptr) {
    scene.vertex = PlyVertex::gaussian;
    log_scales = Tensor<float>(Shape{n, 3});
    plan.add(std::array<std::string_view, 3>{"scale_0", "scale_1", "scale_2"}, log_scales);
  }
  read_rows(file, header, plan.columns());
  if (scene.vertex == PlyVertex::gaussian) flatten(log_scales, s);
  return scene;
}

void write_ply(const std::filesystem::path& path, const PlyScene& scene) {
  const Surfels& surfels = scene.surfels;
  require(surfels.sh.shape().rank() == 3, "surfels have harmonics", surfels.sh.shape().to_string());
  const std::vector<std::string> names = written_properties(surfels, scene.vertex);
  std::string bytes = "ply\nformat binary_little_endian 1.0\n";
  for (const auto& [key, value] : scene.notes) bytes += fmt::format("comment traceflow {} {}\n", key, value);
  bytes += fmt::format("element vertex {}\n", surfels.count());
  for (const std::string& name : names) bytes += fmt::format("property float {}\n", name);
  bytes += "end_header\n";

  std::vector<float> row;
  bytes.reserve(bytes.size() + static_cast<size_t>(surfels.count()) * names.size() * sizeof(float));
  for (int64_t i = 0; i < surfels.count(); ++i) {
    row.clear();
    append_row(surfels, i, scene.vertex, row);
    bytes.append(reinterpret_cast<const char*>(row.data()), row.size() * sizeof(float));
  }
  write_atomically(path, bytes);
}

void undo_normalisation(const SceneNormalisation& normalisation, Surfels& surfels) {
  const auto log_factor = static_cast<float>(std::log(normalisation.scale));
  for (int64_t i = 0; i < surfels.count(); ++i) {
    store3(surfels.position.row(i), normalisation.in_capture(load3<double>(surfels.position.row(i))));
  }
  for (float& log_scale : surfels.log_scale.values()) log_scale -= log_factor;
}

}  // namespace traceflow
