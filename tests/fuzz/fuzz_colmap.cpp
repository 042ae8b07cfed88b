// Bytes as a reconstruction of COLMAP: the first says whether its files are text or binary; "@cameras",
// "@images" and "@points" in a line begin the files.
#include <array>
#include <cmath>
#include <set>

#include "capture/formats/colmap/colmap_model.h"
#include "fuzz/scratch_file.h"

using namespace traceflow;
using fuzz::promise;

namespace {

struct Part {
  std::string_view line, file;
};
constexpr std::array<Part, 3> parts = {
    {{"@cameras\n", "cameras"}, {"@images\n", "images"}, {"@points\n", "points3D"}}};

// What follows the line, up to another part's.
std::string_view part_of(std::string_view bytes, std::string_view line) {
  const size_t at = bytes.find(line);
  if (at == std::string_view::npos) return {};
  std::string_view rest = bytes.substr(at + line.size());
  for (const Part& other : parts) rest = rest.substr(0, rest.find(other.line));
  return rest;
}

bool is_finite(const Vec3<double>& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

void check(const ColmapModel& model, size_t file_bytes) {
  promise(model.cameras.size() + model.images.size() + model.points.size() <= file_bytes,
          "no more rows than the files can hold");
  for (const ColmapCamera& camera : model.cameras) {
    promise(
        camera.lens.width > 0 && camera.lens.height > 0 && camera.lens.focal.x > 0 && camera.lens.focal.y > 0,
        "a camera has a size and a focal length");
    promise(std::isfinite(camera.lens.focal.x) && std::isfinite(camera.lens.centre.x), "a lens is finite");
    promise(model.camera(camera.id) == &camera, "a camera is found by its id");
  }
  std::set<std::string> names;
  for (const ColmapImage& image : model.images) {
    promise(model.camera(image.camera_id) != nullptr, "an image has a camera");
    promise(!image.name.empty() && names.insert(image.name).second, "names differ");
    promise(is_finite(image.position), "a position is finite");
    promise(std::abs(determinant(image.camera_from_world) - 1) < 1e-6, "a rotation is one");
    promise(image.points_seen >= 0 && image.points_seen <= static_cast<int64_t>(file_bytes),
            "no more points than the file can hold");
  }
  for (const ColmapPoint& point : model.points) {
    promise(is_finite(point.position), "a point is finite");
    promise(point.track_length >= 0 && point.track_length <= static_cast<int64_t>(file_bytes),
            "no longer track than the file can hold");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 1) return 0;
  static const fuzz::ScratchFolder folder;
  const std::string_view bytes = fuzz::text_of(data + 1, size - 1);
  const bool is_text = data[0] == 't';
  for (const Part& part : parts) {
    const std::string stem = folder.path() / part.file;
    std::filesystem::remove(stem + (is_text ? ".bin" : ".txt"));
    folder.write(stem + (is_text ? ".txt" : ".bin"), part_of(bytes, part.line));
  }
  fuzz::accepts(folder.path().string(), [&] {
    const auto tree = FileTree::open(folder.path());
    check(read_colmap_model(*tree, ""), size);
  });
  return 0;
}
