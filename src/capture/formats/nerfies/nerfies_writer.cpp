#include "capture/formats/nerfies/nerfies_writer.h"

#include <nlohmann/json.hpp>

#include "base/atomic_file.h"

namespace traceflow {

namespace {

using nlohmann::json;

void write_json(const std::filesystem::path& path, const json& value) {
  write_atomically(path, value.dump(1) + "\n");
}

json as_json(const Vec3<double>& v) { return {v.x, v.y, v.z}; }

json as_json(const Camera<double>& camera) {
  const Mat3<double> rows = glm::transpose(camera.camera_from_world);
  return {{"orientation", {as_json(rows[0]), as_json(rows[1]), as_json(rows[2])}},
          {"position", as_json(camera.position)},
          {"focal_length", camera.focal_x},
          {"principal_point", {camera.centre_x, camera.centre_y}},
          {"skew", 0.0},
          {"pixel_aspect_ratio", camera.focal_y / camera.focal_x},
          {"radial_distortion", {0.0, 0.0, 0.0}},
          {"tangential_distortion", {0.0, 0.0}},
          {"image_size", {camera.width, camera.height}}};
}

json as_json(const NerfiesScene& scene) {
  json value{{"scale", scene.normalisation.scale}, {"center", as_json(scene.normalisation.centre)}};
  if (scene.far_plane > 0) {
    value["near"] = scene.near_plane;
    value["far"] = scene.far_plane;
  }
  return value;
}

json metadata_json(const std::vector<NerfiesView>& views) {
  json metadata = json::object();
  for (const NerfiesView& view : views) {
    metadata[view.id] = {{"time_id", view.time},
                         {"warp_id", view.order},
                         {"appearance_id", view.order},
                         {"camera_id", view.camera_id}};
  }
  return metadata;
}

json dataset_json(const std::vector<NerfiesView>& views) {
  json ids = json::array(), train_ids = json::array(), val_ids = json::array();
  for (const NerfiesView& view : views) {
    ids.push_back(view.id);
    (view.is_test ? val_ids : train_ids).push_back(view.id);
  }
  return {{"count", views.size()},
          {"num_exemplars", train_ids.size()},
          {"ids", ids},
          {"train_ids", train_ids},
          {"val_ids", val_ids}};
}

}  // namespace

void write_nerfies_layout(const std::filesystem::path& folder, const std::vector<NerfiesView>& views,
                          const NerfiesScene& scene) {
  for (const NerfiesView& view : views)
    write_json(folder / "camera" / (view.id + ".json"), as_json(view.camera));
  write_json(folder / "metadata.json", metadata_json(views));
  write_json(folder / "scene.json", as_json(scene));
  write_json(folder / "dataset.json", dataset_json(views));
}

}  // namespace traceflow
