#include "capture/formats/nerfies/nerfies.h"

#include "base/error.h"
#include "base/parallel.h"
#include "capture/formats/image_names.h"
#include "capture/formats/nerfies/dycheck.h"
#include "capture/formats/nerfies/nerfies_camera.h"
#include "capture/formats/nerfies/nerfies_layout.h"
#include "files/limits.h"
#include "files/npy.h"

namespace traceflow {

namespace {

using ReadLayout = NerfiesLayout (*)(const FileTree& tree, std::vector<Finding>& warnings);

std::string camera_path(const std::string& id) { return "camera/" + id + ".json"; }

// Reads step by step into `found_`.
class NerfiesReader {
 public:
  NerfiesReader(std::shared_ptr<const FileTree> tree, const CaptureOptions& options, ReadLayout read_layout)
      : tree_(std::move(tree)), layout_(read_layout(*tree_, found_.warnings)) {
    found_.format = layout_.format;
    found_.transparent_is_unknown = layout_.transparent_is_unknown;
    found_.normalisation = layout_.normalisation;
    found_.near_plane = layout_.near_plane;
    found_.far_plane = layout_.far_plane;
    found_.train_ids = layout_.train_ids;
    found_.all_ids = layout_.all_ids;
    const auto folder_at = [](int stored) { return "rgb/" + std::to_string(stored) + "x"; };
    found_.images = choose_images(
        tree_->name_of(folder_at(1)), options.downscale,
        [&](int stored) { return tree_->has_folder(folder_at(stored)); }, folder_at);
    for (const auto* ids : {&layout_.all_ids, &layout_.train_ids, &layout_.test_ids}) {
      for (const std::string& id : *ids) found_.listed_images.push_back(in_folder(found_.images.folder, id));
    }
  }

  FoundCapture read() {
    found_.train = read_split(layout_.train_ids, "training");
    found_.test = read_split(layout_.test_ids, "test");
    read_points();
    return std::move(found_);
  }

 private:
  // PNG is usual; JPEG is accepted too.
  std::string image_path(const std::string& id) const {
    const std::string stem = found_.images.folder + "/" + id;
    for (const char* extension : image_extensions) {
      if (tree_->has(stem + extension)) return stem + extension;
    }
    return "";
  }

  std::vector<FoundView> read_split(std::vector<std::string> ids, const std::string& split) {
    const auto keep = [&](const std::string& what, const std::string& kind, auto&& exists, auto&& path_of) {
      ids = keep_whole(ids, split, what, exists, found_.warnings, kind, path_of);
    };
    const auto usual_image = [&](const std::string& id) { return found_.images.folder + "/" + id + ".png"; };
    keep(
        "image", "missing-image", [&](const std::string& id) { return !image_path(id).empty(); },
        usual_image);
    keep(
        "camera", "missing-camera", [&](const std::string& id) { return tree_->has(camera_path(id)); },
        camera_path);
    keep(
        "time in metadata.json", "missing-time",
        [&](const std::string& id) { return layout_.time_id.contains(id); }, nullptr);
    std::vector<FoundView> views(ids.size());
    parallel_for(
        "capture: cameras", static_cast<int64_t>(ids.size()),
        [&](int64_t i) { views[static_cast<size_t>(i)] = read_view(ids[static_cast<size_t>(i)]); }, 1);
    return views;
  }

  FoundView read_view(const std::string& id) const {
    const CapturedCamera camera = read_nerfies_camera(tree_->open_file(camera_path(id)));
    const auto rig_camera = layout_.rig_camera.find(id);
    return {id,
            {tree_, image_path(id)},
            camera.lens,
            tree_->name_of(camera_path(id)),
            camera.camera_from_world,
            camera.position,
            layout_.time_id.at(id),
            rig_camera == layout_.rig_camera.end() ? "" : rig_camera->second};
  }

  void read_points() {
    const std::string path = "points.npy";
    if (!tree_->has(path)) return;
    const NpyFile array(tree_->open_file(path));
    const Shape& shape = array.shape();
    if (shape.rank() != 2 || shape[1] != 3)
      throw InputError(tree_->name_of(path), "shape", shape.to_string(), "P×3");
    if (shape[0] > max_capture_points) {
      throw InputError(tree_->name_of(path), "shape", shape.to_string(),
                       "at most " + std::to_string(max_capture_points) + " points", "keep fewer of them");
    }
    const Tensor<float> raw = array.read();
    found_.points_file = path;
    for (int64_t i = 0; i < raw.dim(0); ++i) found_.points.push_back(load3<double>(raw.row(i)));
  }

  std::shared_ptr<const FileTree> tree_;
  FoundCapture found_;
  NerfiesLayout layout_;
};

}  // namespace

bool is_nerfies(const FileTree& tree) { return tree.has("dataset.json"); }

FoundCapture read_nerfies(const std::shared_ptr<const FileTree>& tree, const CaptureOptions& options) {
  return NerfiesReader(tree, options, read_nerfies_layout).read();
}

FoundCapture read_dycheck(const std::shared_ptr<const FileTree>& tree, const CaptureOptions& options) {
  return NerfiesReader(tree, options, read_dycheck_layout).read();
}

}  // namespace traceflow
