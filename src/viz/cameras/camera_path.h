#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "scene/viewpoint.h"
#include "viz/cameras/shot.h"

namespace traceflow::viz {

// Where a camera stands, and when.
struct Pose : Viewpoint {
  double time = 0;  // of the scene, 0 to 1
};

struct Keyframe : Pose {
  double seconds = 1;  // from here to the next
};

// The camera path of web/src/messages.ts.
struct CameraPath {
  int width = 1280, height = 720;  // pixels
  double fps = 30;
  bool closed = false;  // goes back to the first keyframe
  std::vector<Keyframe> keyframes;
};

// Most frames that a path may have.
inline constexpr int64_t path_frames_cap = 100'000;

// Reads a path's JSON. Throws InputError that begins with `where` and names keyframe and field: for what is
// missing, not a number or out of range, a rotation that is none, more than 10,000 keyframes or
// path_frames_cap frames.
CameraPath parse_camera_path(const std::string& text, const std::string& where);
CameraPath read_camera_path(const std::filesystem::path& path);

// Frames that the path has. Throws InputError beyond path_frames_cap.
int64_t frame_count(const CameraPath& path);

// The pose of every frame: the first is the first keyframe's and, unless the path is closed, the last the
// last one's.
std::vector<Pose> frames_of(const CameraPath& path);

// The same as cameras in the scene's units, of the path's size, named 00000, 00001, ….
std::vector<Shot> shots_of(const CameraPath& path, const SceneNormalisation& normalisation);

}  // namespace traceflow::viz
