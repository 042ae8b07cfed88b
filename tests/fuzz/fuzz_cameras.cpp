// Bytes as a list of cameras, and as a camera path.
#include <cmath>
#include <set>

#include "fuzz/scratch_file.h"
#include "viz/cameras/camera_file.h"
#include "viz/cameras/camera_path.h"

using namespace traceflow;
using fuzz::promise;

namespace {

void check(const viz::Shot& shot, int longest_side) {
  const Camera<float>& camera = shot.camera;
  promise(camera.width >= 1 && camera.width <= longest_side && camera.height >= 1 &&
              camera.height <= longest_side,
          "a size is in its range");
  promise(camera.focal_x > 0 && std::isfinite(camera.focal_x) && camera.focal_y > 0 &&
              std::isfinite(camera.focal_y),
          "a focal length is a length");
  promise(std::isfinite(camera.centre_x) && std::isfinite(camera.centre_y), "a centre is a place");
  promise(std::abs(determinant(camera.camera_from_world) - 1) < 0.1, "a rotation is one");
  promise(std::isfinite(length(camera.position)), "a position is finite");
  promise(!shot.time || (*shot.time >= 0 && *shot.time <= 1), "a time is in its range");
  const std::filesystem::path inside = ("out" / std::filesystem::path(shot.name)).lexically_normal();
  promise(*inside.begin() == "out" && inside.has_filename() && inside != "out", "a name stays in its folder");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const fuzz::ScratchFolder folder;
  const std::string_view text = fuzz::text_of(data, size);
  const auto path = folder.write("cameras.json", text);
  std::vector<viz::Shot> shots;
  if (fuzz::accepts(path.string(), [&] { shots = viz::read_cameras(path, {{1, 2, 3}, 0.5}); })) {
    promise(!shots.empty(), "there is a camera");
    std::set<std::string> names;
    for (const viz::Shot& shot : shots) {
      check(shot, 32768);
      promise(names.insert(shot.name).second, "names differ");
    }
  }
  viz::CameraPath along;
  if (!fuzz::accepts("camera path",
                     [&] { along = viz::parse_camera_path(std::string(text), "camera path"); }))
    return 0;
  const int64_t frames = viz::frame_count(along);
  promise(frames >= 1 && frames <= viz::path_frames_cap, "a path has frames");
  if (frames > 1000) return 0;
  shots = viz::shots_of(along, {{1, 2, 3}, 0.5});
  promise(static_cast<int64_t>(shots.size()) == frames, "each frame is a shot");
  for (const viz::Shot& shot : shots) check(shot, 16384);
  return 0;
}
