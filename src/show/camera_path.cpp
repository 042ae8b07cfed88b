#include "show/camera_path.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <span>

#include "files/input_file.h"
#include "show/path_curve.h"

namespace traceflow::show {

namespace {

using Json = nlohmann::json;

constexpr int64_t file_cap = int64_t{1} << 24;
constexpr size_t keyframes_cap = 10'000;

struct Range {
  double low, high;
  const char* text;
};
constexpr Range side_range = {1, 16384, "a whole number of pixels from 1 to 16384"};
constexpr Range fps_range = {0.1, 1000, "0.1 to 1000 frames a second"};
constexpr Range fov_range = {0.1, 179, "an angle of 0.1 to 179 degrees"};
constexpr Range time_range = {0, 1, "0 to 1"};
constexpr Range seconds_range = {0, 1e6, "0 to 1000000 seconds"};
// Rendering is in single precision, where this must stay finite.
constexpr Range length_range = {-1e30, 1e30, "a finite number"};

// Reads the fields of one object; every error names it.
class Reader {
 public:
  // name: of the object in errors; empty for the whole.
  Reader(std::string where, std::string name, const Json& json)
      : where_(std::move(where)), name_(std::move(name)), json_(json) {
    if (!json.is_object()) fail("", json.type_name(), "an object");
  }

  [[noreturn]] void fail(const std::string& key, const std::string& found,
                         const std::string& expected) const {
    throw InputError(where_, name_ + (name_.empty() || key.empty() ? "" : ", ") + key, found, expected);
  }
  const Json& at(const char* key) const {
    const auto found = json_.find(key);
    if (found == json_.end() || found->is_null()) fail(key, "nothing", "a value");
    return *found;
  }
  double number(const char* key, const Range& range) const { return number_in(at(key), key, range); }
  int side(const char* key) const {
    const double value = number(key, side_range);
    if (value != std::floor(value)) fail(key, fmt::format("{}", value), side_range.text);
    return static_cast<int>(value);
  }
  bool flag(const char* key) const {
    if (!at(key).is_boolean()) fail(key, at(key).type_name(), "true or false");
    return at(key).get<bool>();
  }
  Vec3<double> vector(const char* key) const { return vector_in(at(key), key); }
  // Three rows.
  Mat3<double> rotation(const char* key) const {
    const Json& rows = at(key);
    if (!rows.is_array() || rows.size() != 3) fail(key, "no list of three", "three rows of three numbers");
    const Mat3<double> r =
        transpose(Mat3<double>(vector_in(rows[0], key), vector_in(rows[1], key), vector_in(rows[2], key)));
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        if (!(std::abs(dot(r[i], r[j]) - (i == j ? 1 : 0)) <= 1e-3))
          fail(key, "columns that are not orthonormal", "a rotation");
      }
    }
    if (!(determinant(r) > 0)) fail(key, "a mirrored frame", "a rotation");
    return r;
  }

 private:
  double number_in(const Json& value, const char* key, const Range& range) const {
    if (!value.is_number()) fail(key, value.type_name(), range.text);
    const auto number = value.get<double>();
    if (!(number >= range.low && number <= range.high)) fail(key, value.dump(), range.text);
    return number;
  }
  Vec3<double> vector_in(const Json& value, const char* key) const {
    if (!value.is_array() || value.size() != 3) fail(key, value.type_name(), "three numbers");
    const auto at = [&](size_t i) { return number_in(value[i], key, length_range); };
    return {at(0), at(1), at(2)};
  }

  std::string where_, name_;
  const Json& json_;
};

Keyframe read_keyframe(const Reader& reader) {
  Keyframe key;
  key.position = reader.vector("position");
  key.world_from_camera = reader.rotation("rotation");
  key.fov_y = reader.number("fov_y", fov_range);
  key.time = reader.number("time", time_range);
  key.seconds = reader.number("seconds", seconds_range);
  return key;
}

// Whether the path goes on from this keyframe to another.
bool counts(const CameraPath& path, size_t keyframe) {
  return path.closed || keyframe + 1 < path.keyframes.size();
}

}  // namespace

CameraPath parse_camera_path(const std::string& text, const std::string& where) {
  const Json json = Json::parse(text, nullptr, false);
  if (json.is_discarded()) throw InputError(where, "", "text that is not JSON", "a camera path");
  const Reader reader(where, "", json);
  if (reader.at("format") != "traceflow camera path") {
    const Json& format = reader.at("format");
    reader.fail("format", format.is_string() ? format.get<std::string>().substr(0, 60) : format.type_name(),
                "traceflow camera path");
  }
  if (reader.at("version") != 1) {
    const Json& version = reader.at("version");
    reader.fail("version", version.is_number() ? version.dump() : version.type_name(),
                "1, the version that this program knows");
  }
  CameraPath path;
  path.width = reader.side("width");
  path.height = reader.side("height");
  path.fps = reader.number("fps", fps_range);
  path.closed = reader.flag("closed");
  const Json& list = reader.at("keyframes");
  if (!list.is_array()) reader.fail("keyframes", list.type_name(), "a list");
  if (list.empty() || list.size() > keyframes_cap)
    reader.fail("keyframes", fmt::format("{} of them", list.size()), "1 to 10000");
  for (size_t i = 0; i < list.size(); ++i) {
    const Reader entry(where, fmt::format("keyframe {}", i), list[i]);
    path.keyframes.push_back(read_keyframe(entry));
  }
  for (size_t i = 0; i < list.size(); ++i) {
    if (counts(path, i) && !(path.keyframes[i].seconds >= 1e-3))
      throw InputError(where, fmt::format("keyframe {}, seconds", i),
                       fmt::format("{}", path.keyframes[i].seconds),
                       "0.001 or more from one keyframe to the next");
  }
  frame_count(path);
  return path;
}

CameraPath read_camera_path(const std::filesystem::path& path) {
  const InputFile file(path);
  if (file.size() > file_cap)
    throw InputError(path.string(), "", fmt::format("{} bytes", file.size()), "a camera path under 16 MiB");
  std::string text(static_cast<size_t>(file.size()), '\0');
  file.read_at(0, std::as_writable_bytes(std::span(text.data(), text.size())));
  return parse_camera_path(text, path.string());
}

int64_t frame_count(const CameraPath& path) {
  double seconds = 0;
  for (size_t i = 0; i < path.keyframes.size(); ++i)
    seconds += counts(path, i) ? path.keyframes[i].seconds : 0;
  const double steps = std::round(seconds * path.fps);
  if (!(steps < static_cast<double>(path_frames_cap))) {
    throw InputError(
        "camera path", "", fmt::format("{:.0f} frames ({} s at {} a second)", steps, seconds, path.fps),
        fmt::format("{} at most", path_frames_cap), "make it shorter, or ask for fewer frames a second");
  }
  const auto whole = static_cast<int64_t>(steps);
  if (path.closed) return std::max<int64_t>(1, whole);
  return path.keyframes.size() == 1 ? 1 : std::max<int64_t>(1, whole) + 1;
}

std::vector<Pose> frames_of(const CameraPath& path) {
  const int64_t frames = frame_count(path);
  const PathCurve curve(path);
  const auto steps = static_cast<double>(path.closed ? frames : std::max<int64_t>(1, frames - 1));
  std::vector<Pose> poses;
  for (int64_t i = 0; i < frames; ++i)
    poses.push_back(curve.at(curve.duration() * (static_cast<double>(i) / steps)));
  return poses;
}

std::vector<Shot> shots_of(const CameraPath& path, const SceneNormalisation& normalisation) {
  std::vector<Shot> shots;
  for (const Pose& pose : frames_of(path)) {
    Camera<double> camera;
    camera.width = path.width;
    camera.height = path.height;
    camera.focal_x = camera.focal_y = path.height / 2.0 / std::tan(pose.fov_y * std::numbers::pi / 360);
    camera.centre_x = path.width / 2.0;
    camera.centre_y = path.height / 2.0;
    camera.camera_from_world = transpose(pose.world_from_camera);
    camera.position = (pose.position - normalisation.centre) * normalisation.scale;
    shots.push_back(
        {fmt::format("{:05}", shots.size()), static_cast<float>(pose.time), convert<float>(camera)});
  }
  return shots;
}

}  // namespace traceflow::show
