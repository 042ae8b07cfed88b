#include "viz/cameras/camera_path.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "files/json_document.h"
#include "viz/cameras/path_curve.h"

namespace traceflow::viz {

namespace {

constexpr size_t keyframes_cap = 10'000;

constexpr int longest_side = 16384;  // pixels

Keyframe read_keyframe(const JsonField& json) {
  Keyframe key;
  key.position = json["position"].vector();
  key.world_from_camera = json["rotation"].rotation();
  key.fov_y = json["fov_y"].number(0.1, 179);
  key.time = json["time"].number(0, 1);
  key.seconds = json["seconds"].number(0, 1e6);
  return key;
}

void check_format(const JsonField& json) {
  const JsonField format = json["format"], version = json["version"];
  if (format.json() != "traceflow camera path") format.expect("traceflow camera path");
  if (version.json() != 1) version.expect("1, the version that this program knows");
}

// Whether a segment of the path starts at this keyframe.
bool counts(const CameraPath& path, size_t keyframe) {
  return path.closed || keyframe + 1 < path.keyframes.size();
}

}  // namespace

CameraPath parse_camera_path(const std::string& text, const std::string& where) {
  const JsonDocument json(where, text);
  check_format(json);
  CameraPath path;
  path.width = static_cast<int>(json["width"].whole(1, longest_side));
  path.height = static_cast<int>(json["height"].whole(1, longest_side));
  path.fps = json["fps"].number(0.1, 1000);
  path.closed = json["closed"].yes();
  const std::vector<JsonField> keyframes = json["keyframes"].elements();
  if (keyframes.empty() || keyframes.size() > keyframes_cap)
    json["keyframes"].fail(fmt::format("{} of them", keyframes.size()), "1 to 10000");
  for (const JsonField& keyframe : keyframes) path.keyframes.push_back(read_keyframe(keyframe));
  for (size_t i = 0; i < keyframes.size(); ++i) {
    if (counts(path, i) && !(path.keyframes[i].seconds >= 1e-3))
      keyframes[i]["seconds"].expect("0.001 or more from one keyframe to the next");
  }
  frame_count(path);
  return path;
}

CameraPath read_camera_path(const std::filesystem::path& path) {
  return parse_camera_path(read_text(path), path.string());
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
    shots.push_back({fmt::format("{:05}", shots.size()), static_cast<float>(pose.time),
                     camera_at(pose, path.width, path.height, normalisation)});
  }
  return shots;
}

}  // namespace traceflow::viz
