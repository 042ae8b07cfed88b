#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "scene/viewpoint.h"
#include "viz/cameras/shot.h"

namespace traceflow::viz {

// A camera's pose and time.
struct Pose : Viewpoint {
  double time = 0;  // of the scene, 0 to 1
};

struct Keyframe : Pose {
  double seconds = 1;  // from here to the next keyframe
};

// The camera path of web/src/messages.ts.
struct CameraPath {
  int width = 1280, height = 720;  // pixels
  double fps = 30;
  bool closed = false;  // returns to the first keyframe
  std::vector<Keyframe> keyframes;
};

// Maximum number of frames of a path.
inline constexpr int64_t path_frames_cap = 100'000;

// Reads a path's JSON. Throws InputError that starts with `where` and names keyframe and field: for values
// that are missing, not numbers or out of range, invalid rotations, more than 10,000 keyframes or more than
// path_frames_cap frames.
CameraPath parse_camera_path(const std::string& text, const std::string& where);
CameraPath read_camera_path(const std::filesystem::path& path);

// The number of frames. Throws InputError above path_frames_cap.
int64_t frame_count(const CameraPath& path);

// The pose of every frame. The first is that of the first keyframe and, unless the path is closed, the last
// that of the last one.
std::vector<Pose> frames_of(const CameraPath& path);

// The same as cameras in the scene's units, with the path's size, named 00000, 00001, ….
std::vector<Shot> shots_of(const CameraPath& path, const SceneNormalisation& normalisation);

}  // namespace traceflow::viz
