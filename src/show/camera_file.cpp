#include "show/camera_file.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "files/input_file.h"

namespace traceflow::show {

namespace {

using Json = nlohmann::json;

constexpr int64_t file_cap = int64_t{1} << 28;
constexpr int side_cap = 32768;

Json parse_file(const std::filesystem::path& path) {
  const InputFile file(path);
  if (file.size() > file_cap) {
    throw InputError(path.string(), "", std::to_string(file.size()) + " bytes",
                     "a list of cameras under 256 MiB");
  }
  std::string text(static_cast<size_t>(file.size()), '\0');
  file.read_at(0, std::as_writable_bytes(std::span(text.data(), text.size())));
  Json json = Json::parse(text, nullptr, false);
  if (json.is_discarded()) throw InputError(path.string(), "", "text that is not JSON", "a list of cameras");
  if (!json.is_array()) throw InputError(path.string(), "", json.type_name(), "a list of cameras");
  if (json.empty()) throw InputError(path.string(), "", "an empty list", "at least one camera");
  return json;
}

// Reads one camera's entry; every error names its place in the list.
class Entry {
 public:
  Entry(const std::filesystem::path& path, size_t index, const Json& json)
      : where_(path.string()), index_(index), json_(json) {
    if (!json.is_object()) fail("", json.type_name(), "an object");
  }

  [[noreturn]] void fail(const std::string& key, const std::string& found,
                         const std::string& expected) const {
    throw InputError(where_, fmt::format("camera {}{}{}", index_, key.empty() ? "" : ", ", key), found,
                     expected);
  }

  bool has(const char* key) const { return json_.contains(key) && !json_[key].is_null(); }

  double number(const char* key) const { return number_in(at(key), key); }
  double number_or(const char* key, double otherwise) const { return has(key) ? number(key) : otherwise; }

  int side(const char* key) const {
    const double value = number(key);
    if (!(value >= 1 && value <= side_cap) || value != std::floor(value)) {
      fail(key, fmt::format("{}", value), "a whole number of pixels from 1 to 32768");
    }
    return static_cast<int>(value);
  }

  double focal(const char* key) const {
    const double value = number(key);
    if (!(value > 0)) fail(key, fmt::format("{}", value), "a positive number of pixels");
    return value;
  }

  Vec3<double> position() const { return vector_in(at("position"), "position"); }

  // Three rows.
  Mat3<double> camera_from_world() const {
    const Json& rows = at("rotation");
    if (!rows.is_array() || rows.size() != 3)
      fail("rotation", "no list of three", "three rows of three numbers");
    // The file's rows are the transposed matrix's columns, in glm's order.
    const Mat3<double> r(vector_in(rows[0], "rotation"), vector_in(rows[1], "rotation"),
                         vector_in(rows[2], "rotation"));
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        if (std::abs(dot(r[i], r[j]) - (i == j ? 1 : 0)) > 1e-3)
          fail("rotation", "rows that are not orthonormal", "a rotation");
      }
    }
    if (!(determinant(r) > 0)) fail("rotation", "a mirrored frame", "a rotation");
    return r;
  }

  std::string name() const {
    if (has("img_name")) {
      if (!json_["img_name"].is_string()) fail("img_name", json_["img_name"].type_name(), "a string");
      return json_["img_name"].get<std::string>();
    }
    if (!has("id")) return fmt::format("{:05}", index_);
    const Json& id = json_["id"];
    if (id.is_string()) return id.get<std::string>();
    if (!id.is_number_integer()) fail("id", id.dump(), "a whole number or a string");
    return id.dump();
  }

  std::optional<float> time() const {
    if (!has("time")) return std::nullopt;
    const double value = number("time");
    if (!(value >= 0 && value <= 1)) fail("time", fmt::format("{}", value), "0 to 1");
    return static_cast<float>(value);
  }

  const std::string& where() const { return where_; }
  std::string field(const char* key) const { return fmt::format("camera {}, {}", index_, key); }

 private:
  const Json& at(const char* key) const {
    if (!has(key)) fail(key, "nothing", "a value");
    return json_[key];
  }
  double number_in(const Json& value, const char* key) const {
    if (!value.is_number()) fail(key, value.type_name(), "a number");
    const double number = value.get<double>();
    // Rendering is in single precision, where this must stay finite.
    if (!(std::abs(number) < 1e30)) fail(key, value.dump(), "a finite number");
    return number;
  }
  Vec3<double> vector_in(const Json& value, const char* key) const {
    if (!value.is_array() || value.size() != 3) fail(key, value.type_name(), "three numbers");
    return {number_in(value[0], key), number_in(value[1], key), number_in(value[2], key)};
  }

  std::string where_;
  size_t index_;
  const Json& json_;
};

Shot read_shot(const Entry& entry, const SceneNormalisation& normalisation) {
  Shot shot;
  shot.name = entry.name();
  check_name(entry.where(), entry.field("img_name"), shot.name);
  shot.time = entry.time();
  Camera<double> camera;
  camera.width = entry.side("width");
  camera.height = entry.side("height");
  camera.focal_x = entry.focal("fx");
  camera.focal_y = entry.focal("fy");
  camera.centre_x = entry.number_or("cx", camera.width / 2.0);
  camera.centre_y = entry.number_or("cy", camera.height / 2.0);
  camera.camera_from_world = entry.camera_from_world();
  camera.position = (entry.position() - normalisation.centre) * normalisation.scale;
  shot.camera = convert<float>(camera);
  return shot;
}

}  // namespace

void check_name(const std::string& where, const std::string& field, const std::string& name) {
  const std::filesystem::path path(name);
  bool good = !name.empty() && name.size() <= 200 && path.is_relative() && path.has_filename();
  for (const std::filesystem::path& part : path) good = good && part != ".." && part != ".";
  for (const char c : name) good = good && static_cast<unsigned char>(c) >= 32 && c != 127;
  if (good) return;
  throw InputError(where, field, Json(name.substr(0, 60)).dump(-1, ' ', true, Json::error_handler_t::replace),
                   "a file name that stays in its folder");
}

std::vector<Shot> read_cameras(const std::filesystem::path& path, const SceneNormalisation& normalisation) {
  const Json list = parse_file(path);
  std::vector<Shot> shots;
  std::set<std::string> names;
  for (size_t i = 0; i < list.size(); ++i) {
    const Entry entry(path, i, list[i]);
    shots.push_back(read_shot(entry, normalisation));
    if (!names.insert(shots.back().name).second) {
      entry.fail("img_name", shots.back().name + " a second time", "names that differ");
    }
  }
  return shots;
}

}  // namespace traceflow::show
