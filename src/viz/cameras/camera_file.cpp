#include "viz/cameras/camera_file.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <set>

#include "base/error.h"
#include "files/json_document.h"
#include "files/limits.h"
#include "math/pixel_limits.h"

namespace traceflow::viz {

namespace {

std::vector<JsonField> cameras_in(const JsonFile& file) {
  if (!file.json().is_array()) file.expect("a list of cameras");
  std::vector<JsonField> cameras = file.elements();
  if (cameras.empty()) file.fail("an empty list", "at least one camera");
  return cameras;
}

// The entry's id, or its index if it has none.
std::string id_of(const JsonField& entry, size_t place) {
  if (!entry.has("id")) return fmt::format("{:05}", place);
  const JsonField id = entry["id"];
  if (id.json().is_string()) return id.text();
  if (!id.json().is_number_integer()) id.expect("a whole number or a string");
  return id.json().dump();
}

// 3DGS and 2DGS put test and training views into one list, with plain image names: both splits of a
// NeRF-synthetic scene have an r_0.
std::string name_of(const JsonField& entry, size_t place, const std::set<std::string>& taken) {
  if (!entry.has("img_name")) return id_of(entry, place);
  std::string name = entry["img_name"].text();
  if (taken.contains(name)) name += "_" + id_of(entry, place);
  return name;
}

Shot read_shot(const JsonField& entry, const SceneNormalisation& normalisation) {
  Shot shot;
  if (entry.has("time")) shot.time = static_cast<float>(entry["time"].number(0, 1));
  Camera<double> camera;
  camera.width = static_cast<int>(entry["width"].whole(1, max_image_side));
  camera.height = static_cast<int>(entry["height"].whole(1, max_image_side));
  camera.focal_x = entry["fx"].number(smallest_pixels, largest_pixels);
  camera.focal_y = entry["fy"].number(smallest_pixels, largest_pixels);
  camera.centre_x =
      entry.has("cx") ? entry["cx"].number(-largest_pixels, largest_pixels) : camera.width / 2.0;
  camera.centre_y =
      entry.has("cy") ? entry["cy"].number(-largest_pixels, largest_pixels) : camera.height / 2.0;
  camera.camera_from_world = transpose(entry["rotation"].rotation());
  camera.position = normalisation.in_scene(entry["position"].vector());
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
  throw InputError(
      where, field,
      nlohmann::json(name.substr(0, 60)).dump(-1, ' ', true, nlohmann::json::error_handler_t::replace),
      "a file name that stays in its folder");
}

std::vector<Shot> read_cameras(const std::filesystem::path& path, const SceneNormalisation& normalisation) {
  const JsonFile file(path);
  std::vector<Shot> shots;
  std::set<std::string> names;
  for (const JsonField& entry : cameras_in(file)) {
    Shot shot = read_shot(entry, normalisation);
    shot.name = name_of(entry, shots.size(), names);
    check_name(path.string(), fmt::format("[{}].img_name", shots.size()), shot.name);
    if (!names.insert(shot.name).second) entry.fail(shot.name + " a second time", "names that differ");
    shots.push_back(std::move(shot));
  }
  return shots;
}

}  // namespace traceflow::viz
