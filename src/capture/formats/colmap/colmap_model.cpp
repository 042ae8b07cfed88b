#include "capture/formats/colmap/colmap_model.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "base/error.h"
#include "capture/formats/colmap/colmap_lens.h"
#include "capture/formats/colmap/colmap_rows.h"
#include "math/rotation.h"

namespace traceflow {

namespace {

// Double precision is still accurate here, with some margin for arithmetic.
constexpr double far = 1e15;

std::string text_of(const std::vector<double>& numbers) {
  std::string text;
  for (const double v : numbers) text += (text.empty() ? "" : " ") + std::to_string(v);
  return text;
}

bool is_near(const Vec3<double>& v) {
  // Also false for NaN.
  return std::abs(v.x) < far && std::abs(v.y) < far && std::abs(v.z) < far;
}

// The first row whose key an earlier row has; rows.size() if there is none.
template <class Row, class Key>
size_t first_repeated(const std::vector<Row>& rows, Key&& key) {
  std::set<std::decay_t<decltype(key(rows[0]))>> seen;
  for (size_t i = 0; i < rows.size(); ++i) {
    if (!seen.insert(key(rows[i])).second) return i;
  }
  return rows.size();
}

// Builds a model from rows and checks each list.
class Builder {
 public:
  Builder(const FileTree& tree, const std::string& folder) : tree_(tree), folder_(folder) {}

  ColmapModel build() {
    model_.cameras_file = path_of("cameras");
    model_.images_file = path_of("images");
    model_.points_file = path_of("points3D");
    take_cameras();
    take_images();
    if (!model_.points_file.empty()) take_points();
    return std::move(model_);
  }

 private:
  // The .bin file, else the .txt file, else empty.
  std::string path_of(const std::string& name) const {
    for (const char* extension : {".bin", ".txt"}) {
      std::string path = (std::filesystem::path(folder_) / (name + extension)).string();
      if (tree_.has(path)) return path;
    }
    return "";
  }

  template <class Read>
  auto rows_of(const std::string& path, Read&& binary, Read&& text) const {
    return (path.ends_with(".bin") ? binary : text)(tree_.open_file(path));
  }

  template <class Row>
  void check_ids(const std::vector<Row>& rows, const std::string& path, const std::string& list) const {
    const size_t repeated = first_repeated(rows, [](const Row& row) { return row.id; });
    if (repeated == rows.size()) return;
    fail(path, list + "[" + std::to_string(repeated) + "].id",
         std::to_string(rows[repeated].id) + " a second time", "each id once");
  }

  [[noreturn]] void fail(const std::string& path, const std::string& field, const std::string& found,
                         const std::string& expected) const {
    throw InputError(tree_.name_of(path), field, found, expected);
  }

  void take_cameras() {
    const std::string& path = model_.cameras_file;
    const auto rows = rows_of(path, read_colmap_cameras_binary, read_colmap_cameras_text);
    check_ids(rows, path, "cameras");
    for (size_t i = 0; i < rows.size(); ++i) {
      const ColmapCameraRow& row = rows[i];
      const std::string field = "cameras[" + std::to_string(i) + "]";
      const ColmapLensModel* model = find_colmap_lens_model(row.model);
      if (model == nullptr) fail(path, field + ".model", "\"" + row.model + "\"", "a camera model of COLMAP");
      model_.cameras.push_back(
          {row.id, row.model,
           colmap_lens(*model, row.parameters, row.width, row.height, tree_.name_of(path), field)});
    }
    std::ranges::sort(model_.cameras, {}, &ColmapCamera::id);
  }

  void take_images() {
    const std::string& path = model_.images_file;
    const auto rows = rows_of(path, read_colmap_images_binary, read_colmap_images_text);
    check_ids(rows, path, "images");
    const size_t repeated = first_repeated(rows, [](const ColmapImageRow& row) { return row.name; });
    if (repeated < rows.size()) {
      fail(path, "images[" + std::to_string(repeated) + "].name", rows[repeated].name + " a second time",
           "each image once");
    }
    for (size_t i = 0; i < rows.size(); ++i)
      model_.images.push_back(image_of(rows[i], "images[" + std::to_string(i) + "]"));
    std::ranges::sort(model_.images, {}, &ColmapImage::id);
  }

  ColmapImage image_of(const ColmapImageRow& row, const std::string& field) const {
    const std::string& path = model_.images_file;
    const auto& q = row.quaternion;
    const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!(norm > 1e-6 && norm < far))
      fail(path, field + ".qvec", text_of({q.begin(), q.end()}), "a rotation's quaternion");
    const Vec3<double>& t = row.translation;
    if (!is_near(t)) fail(path, field + ".tvec", text_of({t.x, t.y, t.z}), "finite numbers");
    if (row.name.empty()) fail(path, field + ".name", "nothing", "an image's name");
    if (model_.camera(row.camera_id) == nullptr) {
      fail(path, field + ".camera_id", std::to_string(row.camera_id),
           "a camera of " + tree_.name_of(model_.cameras_file));
    }
    const Mat3<double> camera_from_world = rotation_from_quaternion(Vec4<double>(q[0], q[1], q[2], q[3]));
    return {row.id,         row.camera_id, row.name, camera_from_world, -(transpose(camera_from_world) * t),
            row.points_seen};
  }

  void take_points() {
    const std::string& path = model_.points_file;
    const InputFile file = tree_.open_file(path);
    auto rows = path.ends_with(".bin") ? read_colmap_points_binary(file) : read_colmap_points_text(file);
    for (size_t i = 0; i < rows.size(); ++i) {
      const Vec3<double>& x = rows[i].position;
      if (!is_near(x)) {
        fail(path, "points3D[" + std::to_string(i) + "].xyz", text_of({x.x, x.y, x.z}), "finite numbers");
      }
    }
    check_ids(rows, path, "points3D");
    std::ranges::sort(rows, {}, &ColmapPointRow::id);
    for (const ColmapPointRow& row : rows)
      model_.points.push_back({row.position, row.colour, row.error, row.track_length});
  }

  const FileTree& tree_;
  const std::string folder_;
  ColmapModel model_;
};

}  // namespace

const ColmapCamera* ColmapModel::camera(int64_t id) const {
  const auto found = std::ranges::lower_bound(cameras, id, {}, &ColmapCamera::id);
  return found != cameras.end() && found->id == id ? &*found : nullptr;
}

bool has_colmap_model(const FileTree& tree, const std::string& folder) {
  const std::filesystem::path path(folder);
  const auto has = [&](const std::string& name) {
    return tree.has((path / (name + ".bin")).string()) || tree.has((path / (name + ".txt")).string());
  };
  return has("cameras") && has("images");
}

ColmapModel read_colmap_model(const FileTree& tree, const std::string& folder) {
  if (!has_colmap_model(tree, folder)) {
    throw InputError(tree.name_of(folder), "", "no cameras and images", "a COLMAP model, .bin or .txt");
  }
  return Builder(tree, folder).build();
}

}  // namespace traceflow
